"""Draw the ablation."""

from polarsim.job import job
from polarsim.report.figures.gap import draw_gap

with job(snakemake) as call:
    call(draw_gap)
