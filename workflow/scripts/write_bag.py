"""Write a drive as an MCAP bag."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.rover.export.bag import write_bag
from polarsim.rover.export.options import BagOptions
from polarsim.rover.vehicle.table import read_vehicle

with reporting(log=snakemake.log[0]):
    write_bag(
        folder=Path(snakemake.input.trace).parent,
        out=Path(snakemake.output.bag),
        vehicle=read_vehicle(Path(snakemake.input.vehicle)),
        options=BagOptions(**snakemake.params.options),
    )
