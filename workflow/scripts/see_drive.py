"""Take the pictures of one view of a drive."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.rover.frames import render_frames
from polarsim.rover.sight_options import SightOptions
from polarsim.rover.vehicle import read_vehicle

with reporting(log=snakemake.log[0]):
    render_frames(
        Path(snakemake.input.trace).parent,
        read_vehicle(snakemake.input.vehicle),
        SightOptions(views=(snakemake.wildcards.view,), **snakemake.params.sight),
        int(snakemake.wildcards.seed),
        snakemake.threads,
    )
