"""Summarise drives and write their tables."""

from pathlib import Path

from polarsim.job_files import list_of_paths
from polarsim.report.rover_table import tabulate_rover
from polarsim.reporting import reporting
from polarsim.rover.drive.table import summarise_drives

each, together = Path(snakemake.output.each), Path(snakemake.output.together)
with reporting(log=snakemake.log[0]):
    summarise_drives(
        folders=[path.parent for path in list_of_paths(snakemake.input.drives)], each=each, together=together
    )
    tabulate_rover(
        drives=together,
        each=each,
        stem=Path(snakemake.output.table).with_suffix(""),
        each_stem=Path(snakemake.output.each_table).with_suffix(""),
        origin=snakemake.params.origin,
    )
