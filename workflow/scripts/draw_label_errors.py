"""Draw the errors of one terrain's labels."""

from polarsim.job import job
from polarsim.report.figures.labels import draw_label_errors

with job(snakemake) as call:
    call(draw_label_errors)
