"""Make the videos of a drive."""

from pathlib import Path

from polarsim.job import job
from polarsim.rover.exchange.video import make_videos
from polarsim.rover.vehicle.table import read_vehicle

with job(snakemake) as call:
    call(
        make_videos,
        folder=Path(snakemake.output.videos).parent,
        vehicle=read_vehicle(snakemake.input.vehicle),
    )
