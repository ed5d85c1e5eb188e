"""Summarise drives."""

from pathlib import Path

from polarsim.job_files import list_of_paths
from polarsim.reporting import reporting
from polarsim.rover.drive.table import summarise_drives

with reporting(log=snakemake.log[0]):
    summarise_drives(
        folders=[path.parent for path in list_of_paths(snakemake.input.drives)],
        each=Path(snakemake.output.each),
        together=Path(snakemake.output.together),
    )
