"""Tabulate the labels of all terrains and their confidence."""

from polarsim.job import job
from polarsim.report.labels_table import tabulate_labels

with job(snakemake) as call:
    call(
        tabulate_labels,
        table=snakemake.output.table.removesuffix(".csv"),
        reliability=snakemake.output.reliability.removesuffix(".parquet"),
    )
