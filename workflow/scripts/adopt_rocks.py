"""Take over one terrain's published rock meshes."""

from polarsim.job import job
from polarsim.rocks.adopt import adopt_rocks

with job(snakemake) as call:
    call(adopt_rocks)
