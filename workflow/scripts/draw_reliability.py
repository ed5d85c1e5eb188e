"""Draw the confidence of labels against the share of them that are right."""

from polarsim.job import job
from polarsim.report.figures.reliability import draw_reliability

with job(snakemake) as call:
    call(draw_reliability)
