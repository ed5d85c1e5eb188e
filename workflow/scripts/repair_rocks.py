"""Close one terrain's published rock meshes, and list what was wrong with them."""

from polarsim.job import job
from polarsim.rocks.repair import repair_rocks

with job(snakemake) as call:
    call(repair_rocks)
