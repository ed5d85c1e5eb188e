"""Summarise the metrics on board of all drives."""

from pathlib import Path

from polarsim.job_files import list_of_paths
from polarsim.reporting import reporting
from polarsim.rover.perception.summary import summarise_onboard

with reporting(log=snakemake.log[0]):
    summarise_onboard(
        folders=[path.parent.parent for path in list_of_paths(snakemake.input.tables)],
        table=Path(snakemake.output.table),
    )
