"""Write the URDF of the rover."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.rover.export.urdf import write_urdf
from polarsim.rover.vehicle.table import read_vehicle

with reporting(log=snakemake.log[0]):
    write_urdf(
        path=Path(snakemake.output.urdf),
        vehicle=read_vehicle(Path(snakemake.input.vehicle)),
    )
