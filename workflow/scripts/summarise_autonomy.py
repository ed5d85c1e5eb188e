"""Summarise autonomous drives."""

from pathlib import Path

from polarsim.job_files import list_of_paths
from polarsim.reporting import reporting
from polarsim.rover.planning.summary import summarise_autonomy

with reporting(log=snakemake.log[0]):
    summarise_autonomy(
        drives=list_of_paths(snakemake.input.drives),
        each=Path(snakemake.output.each),
        together=Path(snakemake.output.together),
        effects=Path(snakemake.output.effects),
    )
