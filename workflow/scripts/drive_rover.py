"""Drive over the terrains once."""

from pathlib import Path

from polarsim.job import job
from polarsim.rover.drive.ride import run_drive

with job(snakemake) as call:
    call(
        run_drive,
        meshes=Path(snakemake.input.meshes[0]).parent,
        folder=Path(snakemake.output.trace).parent,
        world=snakemake.params.world,
        drive=snakemake.params.drive,
    )
