"""Tabulate the ablation."""

from polarsim.job import job
from polarsim.report.gap_table import tabulate_gap

with job(snakemake) as call:
    call(tabulate_gap, stem=snakemake.output.table.removesuffix(".csv"))
