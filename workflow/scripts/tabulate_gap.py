"""Tabulate the gap ledger."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.tables.gap_table import tabulate_gap

with reporting(log=snakemake.log[0]):
    tabulate_gap(
        ledger=Path(snakemake.input.ledger),
        stem=Path(snakemake.output.table).with_suffix(""),
        origin=snakemake.params.origin,
    )
