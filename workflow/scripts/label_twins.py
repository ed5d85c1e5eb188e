"""Label the twins of one terrain."""

from pathlib import Path

from polarsim.grid import GridOptions, selected_grid
from polarsim.render.automatic import label_twins
from polarsim.render.options import RenderOptions
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    terrain = int(snakemake.wildcards.terrain)
    label_twins(
        terrain=terrain,
        keys=selected_grid(terrain, snakemake.params.positions, GridOptions(**snakemake.params.grid)),
        cameras=Path(snakemake.input.cameras),
        meshes=Path(snakemake.input.meshes),
        boxes=Path(snakemake.output.boxes),
        instances=Path(snakemake.output.instances),
        table=Path(snakemake.output.table),
        options=RenderOptions(**snakemake.params.options),
        threads=snakemake.threads,
    )
