"""Sum up what is seen on board of all drives."""

from pathlib import Path

from polarsim.job import job
from polarsim.rover.onboard.table import summarise_onboard

with job(snakemake) as call:
    call(summarise_onboard, folders=[Path(table).parent.parent for table in snakemake.input.tables])
