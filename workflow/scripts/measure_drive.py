"""Compute metrics of the front camera of a drive."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.rover.cameras.options import CameraSuiteOptions
from polarsim.rover.perception.measure import measure_drive
from polarsim.rover.perception.options import onboard_detector
from polarsim.rover.vehicle.table import read_vehicle

with reporting(log=snakemake.log[0]):
    measure_drive(
        folder=Path(snakemake.input.poses).parent.parent,
        vehicle=read_vehicle(Path(snakemake.input.vehicle)),
        options=CameraSuiteOptions(**snakemake.params.options),
        onboard=onboard_detector(snakemake.params.detector),
        seed=int(snakemake.wildcards.seed),
    )
