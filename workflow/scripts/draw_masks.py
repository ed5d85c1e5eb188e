"""Write polygons, class masks and COCO masks of the photos of a terrain."""

from pathlib import Path

from polarsim.grid import GridOptions, selected_grid
from polarsim.labels.masks import draw_masks
from polarsim.photo import parse_terrain
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    draw_masks(
        site=Site(**snakemake.params.site),
        terrain=parse_terrain(snakemake.wildcards.terrain),
        keys=selected_grid(
            site=Site(**snakemake.params.site),
            terrain=parse_terrain(snakemake.wildcards.terrain),
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
