"""Generate a terrain of the analog sandbox."""

from pathlib import Path

from polarsim.analog.generate import generate_terrain
from polarsim.analog.options import AnalogOptions
from polarsim.grid import GridOptions, selected_grid
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    generate_terrain(
        root=Path(snakemake.output.receipt).parent.parent,
        receipt=Path(snakemake.output.receipt),
        terrain=int(snakemake.wildcards.terrain),
        keys=selected_grid(
            terrain=int(snakemake.wildcards.terrain),
            positions=snakemake.params.positions,
            grid=GridOptions(**snakemake.params.grid),
        ),
        options=AnalogOptions(**snakemake.params.options),
        threads=snakemake.threads,
    )
