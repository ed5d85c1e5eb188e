"""Write the results page of a run."""

from pathlib import Path

from polarsim.job import job
from polarsim.report.results_page import write_results_page

with job(snakemake) as call:
    call(
        write_results_page,
        tables={Path(path).stem: path for path in snakemake.input.tables},
        figures={Path(path).stem: path for path in snakemake.input.figures},
        datasets=dict(zip(snakemake.params.datasets, snakemake.input.datasets, strict=True)),
    )
