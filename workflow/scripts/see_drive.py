"""Take the pictures of one view of a drive."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.rover.sight.frames import render_frames
from polarsim.rover.sight.options import SightOptions
from polarsim.rover.vehicle.table import read_vehicle

with reporting(log=snakemake.log[0]):
    render_frames(
        Path(snakemake.input.trace).parent,
        read_vehicle(snakemake.input.vehicle),
        SightOptions(views=(snakemake.wildcards.view,), **snakemake.params.sight),
        int(snakemake.wildcards.seed),
        snakemake.threads,
    )
