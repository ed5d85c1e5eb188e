"""Hold the soil against its limit and against measured wheels."""

from polarsim.job import job
from polarsim.rover.soil.check import check_soil

with job(snakemake) as call:
    call(check_soil)
