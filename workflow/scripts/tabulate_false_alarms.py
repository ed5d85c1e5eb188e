"""Tabulate rocks that judges see where no rock is labelled."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.tables.false_alarms_table import tabulate_false_alarms

with reporting(log=snakemake.log[0]):
    tabulate_false_alarms(
        false_alarms=Path(snakemake.input.false_alarms),
        detection=Path(snakemake.input.detection),
        stem=Path(snakemake.output.table).with_suffix(""),
        origin=snakemake.params.origin,
    )
