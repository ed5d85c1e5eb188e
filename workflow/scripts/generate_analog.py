"""Generate one terrain of the analog sandbox."""

from pathlib import Path

from polarsim.analog.generate import generate_terrain_at
from polarsim.grid import selected_grid
from polarsim.job import job

with job(snakemake) as call:
    call(
        generate_terrain_at,
        root=Path(snakemake.output.receipt).parent.parent,
        keys=call(selected_grid),
    )
