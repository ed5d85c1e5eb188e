"""Tabulate the rank correlation of gap and drive metrics."""

from pathlib import Path

from polarsim.report.autonomy_table import tabulate_rank
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    tabulate_rank(
        by_detector=Path(snakemake.input.by_detector),
        ranks=Path(snakemake.input.ranks),
        stem=Path(snakemake.output.table).with_suffix(""),
        origin=snakemake.params.origin,
    )
