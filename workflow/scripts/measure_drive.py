"""Measure what the front camera of a drive is worth on board."""

from pathlib import Path

from polarsim.job import job
from polarsim.rover.onboard.measure import measure_drive
from polarsim.rover.vehicle.table import read_vehicle

with job(snakemake) as call:
    call(
        measure_drive,
        folder=Path(snakemake.input.poses).parent.parent,
        vehicle=read_vehicle(snakemake.input.vehicle),
    )
