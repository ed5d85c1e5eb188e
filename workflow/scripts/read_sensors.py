"""Write the readings and the calibration of the sensors of a drive."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.rover.export.sequence import write_sensors_of_drive

with reporting(log=snakemake.log[0]):
    write_sensors_of_drive(
        drive=Path(snakemake.input.trace).parent,
        vehicle=Path(snakemake.input.vehicle),
        views=snakemake.params.views,
        scale=snakemake.params.scale,
        seed=int(snakemake.wildcards.seed),
    )
