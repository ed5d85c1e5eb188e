"""Draw slip, sinkage and offset over time."""

from polarsim.job import job
from polarsim.report.figures.drive import draw_drive

with job(snakemake) as call:
    call(draw_drive)
