"""Tabulate how near the twins of all terrains come to their photos."""

from pathlib import Path

from polarsim.job_files import paths
from polarsim.report.render_table import tabulate_render
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    tabulate_render(
        pairs=paths(snakemake.input.pairs),
        evaluation=paths(snakemake.input.evaluation),
        table=Path(snakemake.output.table).with_suffix(""),
        origin=snakemake.params.origin,
    )
