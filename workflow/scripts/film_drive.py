"""Make the videos of a drive."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.rover.sight_options import SightOptions
from polarsim.rover.vehicle import read_vehicle
from polarsim.rover.video import make_videos

with reporting(log=snakemake.log[0]):
    make_videos(
        Path(snakemake.output.videos).parent,
        read_vehicle(snakemake.input.vehicle),
        SightOptions(**snakemake.params.sight),
        int(snakemake.wildcards.seed),
        snakemake.threads,
    )
