"""Draw the soil's checks."""

from polarsim.job import job
from polarsim.report.figures.soil import draw_soil

with job(snakemake) as call:
    call(draw_soil)
