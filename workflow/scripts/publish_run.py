"""Publish the run in one form."""

from polarsim.job import job
from polarsim.publish.run import publish_run

with job(snakemake) as call:
    call(publish_run)
