"""Tabulate how well masks agree with people's polygons."""

from polarsim.job import job
from polarsim.report.masks_table import tabulate_masks

with job(snakemake) as call:
    call(tabulate_masks, stem=snakemake.output.table.removesuffix(".csv"))
