"""Take the pictures of one view of a drive."""

from pathlib import Path

from polarsim.job import job
from polarsim.rover.cameras.frames import render_frames
from polarsim.rover.vehicle.table import read_vehicle

with job(snakemake) as call:
    call(
        render_frames,
        folder=Path(snakemake.input.trace).parent,
        vehicle=read_vehicle(snakemake.input.vehicle),
        options={"views": [snakemake.wildcards.view], **snakemake.params.options},
    )
