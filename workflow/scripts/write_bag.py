"""Write a drive as a bag."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.rover.exchange.bag import write_bag
from polarsim.rover.exchange.options import BagOptions
from polarsim.rover.vehicle.table import read_vehicle

with reporting(log=snakemake.log[0]):
    write_bag(
        Path(snakemake.input.trace).parent,
        Path(snakemake.output.bag),
        read_vehicle(snakemake.input.vehicle),
        BagOptions(**snakemake.params.options),
        int(snakemake.wildcards.seed),
    )
