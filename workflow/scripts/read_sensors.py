"""Write the readings and the calibration of the sensors of a drive."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.rover.drive.trace import read_trace
from polarsim.rover.export.sequence import write_sensors
from polarsim.rover.vehicle.table import read_vehicle

folder = Path(snakemake.input.trace).parent
with reporting(log=snakemake.log[0]):
    write_sensors(
        folder=folder,
        trace=read_trace(folder),
        vehicle=read_vehicle(Path(snakemake.input.vehicle)),
        views=snakemake.params.views,
        scale=snakemake.params.scale,
        seed=int(snakemake.wildcards.seed),
    )
