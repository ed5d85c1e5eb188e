"""Render the images of a view of a drive."""

from pathlib import Path

from polarsim.render.options import RenderOptions
from polarsim.reporting import reporting
from polarsim.rover.cameras.frames import render_frames
from polarsim.rover.cameras.options import CameraSuiteOptions
from polarsim.rover.vehicle.table import read_vehicle

with reporting(log=snakemake.log[0]):
    render_frames(
        folder=Path(snakemake.input.trace).parent,
        vehicle=read_vehicle(Path(snakemake.input.vehicle)),
        options=CameraSuiteOptions(views=[snakemake.wildcards.view], **snakemake.params.options),
        seed=int(snakemake.wildcards.seed),
        threads=snakemake.threads,
        render=RenderOptions(**snakemake.params.render),
    )
