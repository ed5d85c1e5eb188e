"""Tabulate the metrics on board."""

from pathlib import Path

from polarsim.report.rover_table import tabulate_onboard
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    tabulate_onboard(
        onboard=Path(snakemake.input.onboard),
        stem=Path(snakemake.output.table).with_suffix(""),
        origin=snakemake.params.origin,
    )
