"""Tabulate IPD in the paper's layout."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.tables.ipd_table import tabulate_ipd

with reporting(log=snakemake.log[0]):
    tabulate_ipd(
        ipd=Path(snakemake.input.ipd),
        detection=Path(snakemake.input.detection),
        stem=Path(snakemake.output.table).with_suffix(""),
        origin=snakemake.params.origin,
    )
