"""Detect rocks in the front camera images of a drive."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.rover.cameras.options import CameraSuiteOptions
from polarsim.rover.perception.detections import detect_drive
from polarsim.rover.perception.options import OnboardDetector
from polarsim.rover.vehicle.table import read_vehicle

with reporting(log=snakemake.log[0]):
    detect_drive(
        folder=Path(snakemake.input.poses).parent.parent,
        vehicle=read_vehicle(Path(snakemake.input.vehicle)),
        options=CameraSuiteOptions(**snakemake.params.options),
        onboard=OnboardDetector(**snakemake.params.detector),
        seed=int(snakemake.wildcards.seed),
        threads=snakemake.threads,
    )
