"""Put the tables of all splits and seeds together."""

from polarsim.detect.gather import gather_tables
from polarsim.job import job

with job(snakemake) as call:
    call(gather_tables)
