"""Tabulate drives and the soil's checks."""

from polarsim.job import job
from polarsim.report.rover_table import tabulate_rover

with job(snakemake) as call:
    call(
        tabulate_rover,
        stem=snakemake.output.table.removesuffix(".csv"),
        each_stem=snakemake.output.each_table.removesuffix(".csv"),
        soil_stem=snakemake.output.soil_table.removesuffix(".csv"),
        checks_stem=snakemake.output.checks_table.removesuffix(".csv"),
    )
