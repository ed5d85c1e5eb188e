"""Draw every reflectance model over the phase angle."""

from polarsim.job import job
from polarsim.report.figures.brdf import draw_reflectance

with job(snakemake) as call:
    call(draw_reflectance)
