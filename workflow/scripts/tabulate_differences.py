"""Tabulate paired differences."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.tables.differences_table import tabulate_differences

with reporting(log=snakemake.log[0]):
    tabulate_differences(
        differences=Path(snakemake.input.differences),
        detection=Path(snakemake.input.detection),
        stem=Path(snakemake.output.table).with_suffix(""),
        origin=snakemake.params.origin,
    )
