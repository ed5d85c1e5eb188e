"""Simulate a drive along a path."""

from pathlib import Path

from polarsim.job_files import list_of_paths
from polarsim.reporting import reporting
from polarsim.rover.drive.options import DriveOptions
from polarsim.rover.drive.ride import run_drive
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.world.options import WorldOptions

with reporting(log=snakemake.log[0]):
    run_drive(
        meshes=list_of_paths(snakemake.input.meshes)[0].parent,
        parts=Path(snakemake.input.parts),
        folder=Path(snakemake.output.trace).parent,
        world=WorldOptions(**snakemake.params.world),
        soil=SoilOptions(**snakemake.params.soil),
        drive=DriveOptions(**snakemake.params.drive),
        seed=int(snakemake.wildcards.seed),
    )
