"""Draw every cover photo with its labels and with what a detector finds."""

from polarsim.job import job
from polarsim.report.figures.covers import draw_covers

with job(snakemake) as call:
    call(draw_covers)
