"""Summarise the metrics on board of all drives and write their table."""

from pathlib import Path

from polarsim.job_files import list_of_paths
from polarsim.report.rover_table import tabulate_onboard
from polarsim.reporting import reporting
from polarsim.rover.perception.summary import summarise_onboard

onboard = Path(snakemake.output.onboard)
with reporting(log=snakemake.log[0]):
    summarise_onboard(folders=[path.parent.parent for path in list_of_paths(snakemake.input.tables)], table=onboard)
    tabulate_onboard(onboard=onboard, stem=Path(snakemake.output.table).with_suffix(""), origin=snakemake.params.origin)
