"""Tabulate drives in which the rover decides, and what each axis changes."""

from polarsim.job import job
from polarsim.report.autonomy_table import tabulate_autonomy

with job(snakemake) as call:
    stems = [table.removesuffix(".csv") for table in (snakemake.output.table, snakemake.output.effects_table)]
    call(tabulate_autonomy, stem=stems[0], effects_stem=stems[1])
