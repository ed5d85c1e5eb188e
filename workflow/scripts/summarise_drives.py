"""Sum up drives one by one and together."""

from pathlib import Path

from polarsim.job import job
from polarsim.rover.drive.table import summarise_drives

with job(snakemake) as call:
    call(summarise_drives, folders=[Path(drive).parent for drive in snakemake.input.drives])
