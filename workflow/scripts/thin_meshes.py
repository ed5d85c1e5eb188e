"""Copy one terrain's ground and thinned rocks."""

from polarsim.job import job
from polarsim.scoring.true_scene import thin_meshes

with job(snakemake) as call:
    call(thin_meshes)
