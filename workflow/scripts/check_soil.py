"""Hold the soil against its limit, measured wheels and what others published."""

from polarsim.job import job
from polarsim.rover.soil.published import check_soil

with job(snakemake) as call:
    call(check_soil)
