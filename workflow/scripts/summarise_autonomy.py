"""Sum up drives in which the rover decides, one by one and together."""

from polarsim.job import job
from polarsim.rover.autonomy.table import summarise_autonomy

with job(snakemake) as call:
    call(summarise_autonomy)
