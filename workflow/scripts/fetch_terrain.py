"""Fetch and unpack one terrain's raw data."""

from polarsim.acquire.fetch import fetch_terrain
from polarsim.job import job

with job(snakemake) as call:
    call(fetch_terrain, done=snakemake.output.receipt)
