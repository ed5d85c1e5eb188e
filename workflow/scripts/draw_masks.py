"""Write polygons, class masks and COCO masks of the photos of a terrain."""

from pathlib import Path

from polarsim.grid import GridOptions, selected_grid
from polarsim.labels.masks import draw_masks
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    draw_masks(
        terrain=int(snakemake.wildcards.terrain),
        keys=selected_grid(
            terrain=int(snakemake.wildcards.terrain),
            positions=snakemake.params.positions,
            grid=GridOptions(**snakemake.params.grid),
        ),
        photos=Path(snakemake.input.photos),
        table=Path(snakemake.input.table),
        cameras=Path(snakemake.input.cameras),
        meshes=Path(snakemake.input.meshes),
        polygons=Path(snakemake.output.polygons),
        masks=Path(snakemake.output.masks),
        preview=Path(snakemake.output.preview),
        annotations=Path(snakemake.output.annotations),
    )
