"""Split one terrain's scans into rocks and ground."""

from polarsim.job import job
from polarsim.rocks.find import find_rocks

with job(snakemake) as call:
    call(find_rocks)
