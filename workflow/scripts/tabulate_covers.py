"""Write the table of what detectors find in real cover photos."""

from polarsim.job import job
from polarsim.report.covers_table import tabulate_covers

with job(snakemake) as call:
    call(tabulate_covers, stem=snakemake.output.table.removesuffix(".csv"))
