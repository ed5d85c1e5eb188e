"""Make the videos of a drive."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.rover.cameras.options import CameraSuiteOptions
from polarsim.rover.exchange.video import make_videos
from polarsim.rover.vehicle.table import read_vehicle

with reporting(log=snakemake.log[0]):
    make_videos(
        Path(snakemake.output.videos).parent,
        read_vehicle(snakemake.input.vehicle),
        CameraSuiteOptions(**snakemake.params.cameras),
        int(snakemake.wildcards.seed),
        snakemake.threads,
    )
