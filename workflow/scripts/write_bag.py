"""Write a drive as a bag."""

from pathlib import Path

from polarsim.job import job
from polarsim.rover.exchange.bag import write_bag
from polarsim.rover.vehicle.table import read_vehicle

with job(snakemake) as call:
    call(
        write_bag,
        folder=Path(snakemake.input.trace).parent,
        out=snakemake.output.bag,
        vehicle=read_vehicle(snakemake.input.vehicle),
    )
