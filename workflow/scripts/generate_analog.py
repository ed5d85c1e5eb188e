"""Generate one terrain of the analog sandbox."""

from pathlib import Path

from polarsim.analog.generate import generate_terrain_at
from polarsim.analog.options import AnalogOptions
from polarsim.grid import GridOptions, selected_grid
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    terrain = int(snakemake.wildcards.terrain)
    generate_terrain_at(
        root=Path(snakemake.output.receipt).parent.parent,
        receipt=Path(snakemake.output.receipt),
        terrain=terrain,
        keys=selected_grid(terrain, snakemake.params.positions, GridOptions(**snakemake.params.grid)),
        options=AnalogOptions(**snakemake.params.options),
        threads=snakemake.threads,
    )
