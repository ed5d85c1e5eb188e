"""Look for rocks in the front camera's pictures of a drive."""

from pathlib import Path

from polarsim.job import job
from polarsim.rover.onboard.detections import detect_drive
from polarsim.rover.vehicle.table import read_vehicle

with job(snakemake) as call:
    call(
        detect_drive,
        folder=Path(snakemake.input.poses).parent.parent,
        vehicle=read_vehicle(snakemake.input.vehicle),
    )
