"""Tabulate what is seen on board."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.tables.rover_table import tabulate_onboard

with reporting(log=snakemake.log[0]):
    tabulate_onboard(
        onboard=Path(snakemake.input.onboard),
        stem=Path(snakemake.output.table).with_suffix(""),
        origin=snakemake.params.origin,
    )
