"""Tabulate how the detectors' order by gap agrees with that by drives."""

from polarsim.job import job
from polarsim.report.autonomy_table import tabulate_rank

with job(snakemake) as call:
    call(tabulate_rank, stem=snakemake.output.table.removesuffix(".csv"))
