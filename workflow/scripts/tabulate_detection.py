"""Tabulate detection in the paper's layout."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.tables.detection_table import tabulate_detection

with reporting(log=snakemake.log[0]):
    tabulate_detection(
        detection=Path(snakemake.input.detection),
        stem=Path(snakemake.output.table).with_suffix(""),
        origin=snakemake.params.origin,
        min_mean_dn=snakemake.params.min_mean_dn,
    )
