"""Tabulate what is seen on board."""

from polarsim.job import job
from polarsim.report.rover_table import tabulate_onboard

with job(snakemake) as call:
    call(tabulate_onboard, stem=snakemake.output.table.removesuffix(".csv"))
