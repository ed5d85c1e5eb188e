"""Estimate the poses of a drive from its sensors."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.rover.drive.trace import read_trace
from polarsim.rover.export.replay import write_estimates
from polarsim.rover.vehicle.table import read_vehicle

folder = Path(snakemake.input.trace).parent
with reporting(log=snakemake.log[0]):
    write_estimates(
        folder=folder,
        trace=read_trace(folder),
        vehicle=read_vehicle(Path(snakemake.input.vehicle)),
        picture_sets=snakemake.params.picture_sets,
        seed=int(snakemake.wildcards.seed),
    )
