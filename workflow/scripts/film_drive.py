"""Write the videos of a drive."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.rover.cameras.options import CameraSuiteOptions
from polarsim.rover.export.video import write_videos
from polarsim.rover.vehicle.table import read_vehicle

with reporting(log=snakemake.log[0]):
    write_videos(
        folder=Path(snakemake.output.videos).parent,
        vehicle=read_vehicle(Path(snakemake.input.vehicle)),
        options=CameraSuiteOptions(**snakemake.params.options),
        seed=int(snakemake.wildcards.seed),
        threads=snakemake.threads,
    )
