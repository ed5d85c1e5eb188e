"""Tabulate how near the twins of all terrains come to their photos."""

from pathlib import Path

from polarsim.report.render_table import tabulate_render
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    tabulate_render(
        pairs=[Path(path) for path in snakemake.input.pairs],
        evaluation=[Path(path) for path in snakemake.input.evaluation],
        table=Path(snakemake.output.table).with_suffix(""),
        origin=snakemake.params.origin,
    )
