"""Write the rover as URDF."""

from polarsim.job import job
from polarsim.rover.exchange.urdf import write_urdf
from polarsim.rover.vehicle.table import read_vehicle

with job(snakemake) as call:
    call(write_urdf, path=snakemake.output.urdf, vehicle=read_vehicle(snakemake.input.vehicle))
