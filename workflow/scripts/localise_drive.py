"""Estimate the poses of a drive from its sensors."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.rover.export.replay import write_estimates_of_drive

with reporting(log=snakemake.log[0]):
    write_estimates_of_drive(
        drive=Path(snakemake.input.trace).parent,
        vehicle=Path(snakemake.input.vehicle),
        picture_sets=snakemake.params.picture_sets,
        seed=int(snakemake.wildcards.seed),
    )
