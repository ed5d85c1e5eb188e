"""Tabulate detection by size of the label, exposure, azimuth, rover light and terrain."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.tables.breakdown_table import tabulate_breakdown

with reporting(log=snakemake.log[0]):
    tabulate_breakdown(
        breakdown=Path(snakemake.input.breakdown),
        detection=Path(snakemake.input.detection),
        stem=Path(snakemake.output.table).with_suffix(""),
        origin=snakemake.params.origin,
    )
