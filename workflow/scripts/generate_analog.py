"""Generate a terrain of the analog sandbox."""

from pathlib import Path

from polarsim.analog.generate import generate_terrain
from polarsim.analog.options import AnalogOptions
from polarsim.grid import GridOptions, selected_grid
from polarsim.photo import parse_terrain
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    generate_terrain(
        site=Site(**snakemake.params.site),
        root=Path(snakemake.output.receipt).parent.parent,
        receipt=Path(snakemake.output.receipt),
        terrain=parse_terrain(snakemake.wildcards.terrain),
        keys=selected_grid(
            site=Site(**snakemake.params.site),
            terrain=parse_terrain(snakemake.wildcards.terrain),
            positions=snakemake.params.positions,
            grid=GridOptions(**snakemake.params.grid),
        ),
        options=AnalogOptions(**snakemake.params.options),
        threads=snakemake.threads,
    )
