"""Carve rocks as the analog's generator does, to strew them."""

from polarsim.analog.carved import carve_rocks
from polarsim.job import job

with job(snakemake) as call:
    call(carve_rocks)
