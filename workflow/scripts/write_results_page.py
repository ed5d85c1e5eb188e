"""Write the results page of a run."""

from pathlib import Path

from polarsim.report.results_page import write_results_page
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    write_results_page(
        tables={Path(path).stem: Path(path) for path in snakemake.input.tables},
        figures={Path(path).stem: Path(path) for path in snakemake.input.figures},
        phases=[Path(path) for path in snakemake.input.phases],
        datasets=dict(zip(snakemake.params.datasets, map(Path, snakemake.input.datasets), strict=True)),
        page=Path(snakemake.output.page),
        origin=snakemake.params.origin,
    )
