"""Draw one photo in a strip of its twin, difference, labels and detections."""

from polarsim.job import job
from polarsim.report.figures.strip import draw_strip

with job(snakemake) as call:
    call(draw_strip)
