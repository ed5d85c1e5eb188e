"""Draw how far one terrain's meshes lie from the true surface."""

from polarsim.job import job
from polarsim.report.figures.offsets import draw_offsets

with job(snakemake) as call:
    call(draw_offsets)
