"""Tabulate stereo depth."""

from polarsim.job import job
from polarsim.report.stereo_table import tabulate_stereo

with job(snakemake) as call:
    call(
        tabulate_stereo,
        stem=snakemake.output.table.removesuffix(".csv"),
        bad_mm=snakemake.params.options["bad_mm"],
        bad_percent=snakemake.params.options["bad_percent"],
    )
