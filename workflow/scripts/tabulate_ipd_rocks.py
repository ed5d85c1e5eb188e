"""Tabulate how well each rock is found in two domains."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.tables.ipd_rocks_table import tabulate_ipd_rocks

with reporting(log=snakemake.log[0]):
    tabulate_ipd_rocks(
        rocks=Path(snakemake.input.rocks),
        detection=Path(snakemake.input.detection),
        stem=Path(snakemake.output.table).with_suffix(""),
        origin=snakemake.params.origin,
    )
