"""Draw how far one terrain's projected meshes lie from the boxes that people drew."""

from polarsim.job import job
from polarsim.report.figures.residuals import draw_residuals

with job(snakemake) as call:
    call(draw_residuals)
