"""Read cover photos, find out which photos they are, and take out what was drawn into them."""

from polarsim.covers.photos import read_covers
from polarsim.job import job

with job(snakemake) as call:
    call(read_covers, keys=snakemake.params.known)
