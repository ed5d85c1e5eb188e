"""Tabulate drives."""

from pathlib import Path

from polarsim.report.rover_table import tabulate_rover
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    tabulate_rover(
        drives=Path(snakemake.input.drives),
        each=Path(snakemake.input.each),
        stem=Path(snakemake.output.table).with_suffix(""),
        each_stem=Path(snakemake.output.each_table).with_suffix(""),
        origin=snakemake.params.origin,
    )
