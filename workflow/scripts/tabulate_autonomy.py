"""Tabulate drives in which the rover decides."""

from polarsim.job import job
from polarsim.report.rover_table import tabulate_autonomy

with job(snakemake) as call:
    call(tabulate_autonomy, stem=snakemake.output.table.removesuffix(".csv"))
