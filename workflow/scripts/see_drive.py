"""Take the pictures of one view of a drive."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.rover.cameras.frames import render_frames
from polarsim.rover.cameras.options import CameraSuiteOptions
from polarsim.rover.vehicle.table import read_vehicle

with reporting(log=snakemake.log[0]):
    render_frames(
        Path(snakemake.input.trace).parent,
        read_vehicle(snakemake.input.vehicle),
        CameraSuiteOptions(views=(snakemake.wildcards.view,), **snakemake.params.cameras),
        int(snakemake.wildcards.seed),
        snakemake.threads,
    )
