"""Measure what the front camera of a drive is worth on board."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.rover.cameras.options import CameraSuiteOptions
from polarsim.rover.onboard.measure import measure_drive
from polarsim.rover.vehicle.table import read_vehicle

with reporting(log=snakemake.log[0]):
    measure_drive(
        Path(snakemake.input.poses).parent.parent,
        read_vehicle(snakemake.input.vehicle),
        CameraSuiteOptions(**snakemake.params.cameras),
        int(snakemake.wildcards.seed),
    )
