"""Write how bright every reflectance model is over the phase angle."""

from polarsim.job import job
from polarsim.render.goniometer import write_reflectance

with job(snakemake) as call:
    call(write_reflectance)
