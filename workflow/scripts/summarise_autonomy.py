"""Summarise autonomous drives."""

from pathlib import Path

from polarsim.job_files import paths
from polarsim.reporting import reporting
from polarsim.rover.planning.summary import summarise_autonomy

with reporting(log=snakemake.log[0]):
    summarise_autonomy(
        drives=paths(snakemake.input.drives),
        each=Path(snakemake.output.each),
        together=Path(snakemake.output.together),
        effects=Path(snakemake.output.effects),
    )
