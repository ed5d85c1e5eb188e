"""Merge the photo tables of all terrains."""

from polarsim.acquire.index import merge_photos
from polarsim.job import job

with job(snakemake) as call:
    call(merge_photos)
