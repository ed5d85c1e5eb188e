"""Take one terrain's raw data in."""

from polarsim.acquire.index import index_terrain
from polarsim.job import job

with job(snakemake) as call:
    call(index_terrain)
