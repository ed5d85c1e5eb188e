"""Tabulate how near the twins of all terrains come to their photos."""

from polarsim.job import job
from polarsim.report.render_table import tabulate_render

with job(snakemake) as call:
    call(tabulate_render, table=snakemake.output.table.removesuffix(".csv"))
