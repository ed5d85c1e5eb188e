"""Look for rocks in the front camera's pictures of a drive."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.rover.cameras.options import CameraSuiteOptions
from polarsim.rover.onboard.detections import detect_drive
from polarsim.rover.vehicle.table import read_vehicle

with reporting(log=snakemake.log[0]):
    detect_drive(
        Path(snakemake.input.poses).parent.parent,
        read_vehicle(snakemake.input.vehicle),
        CameraSuiteOptions(**snakemake.params.cameras),
        int(snakemake.wildcards.seed),
        snakemake.threads,
    )
