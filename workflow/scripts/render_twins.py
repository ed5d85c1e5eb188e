"""Render the twins of one terrain under every reflectance model, and label them."""

from pathlib import Path

from polarsim.grid import GridOptions, selected_grid
from polarsim.render.options import RenderOptions
from polarsim.render.twins import LabelPaths, render_twins
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    terrain = int(snakemake.wildcards.terrain)
    render_twins(
        terrain=terrain,
        keys=selected_grid(terrain, snakemake.params.positions, GridOptions(**snakemake.params.grid)),
        cameras=Path(snakemake.input.cameras),
        meshes=Path(snakemake.input.meshes),
        photos=Path(snakemake.input.photos) if snakemake.input.photos else None,
        twins={model: Path(snakemake.output[model]) for model in snakemake.params.models},
        labels=LabelPaths(
            boxes=Path(snakemake.output.boxes),
            instances=Path(snakemake.output.instances),
            annotations=Path(snakemake.output.annotations),
            table=Path(snakemake.output.table),
            maps=Path(snakemake.output.maps) if snakemake.params.options["maps"] else None,
        ),
        options=RenderOptions(**snakemake.params.options),
        threads=snakemake.threads,
        materials=Path(snakemake.input.materials) if snakemake.input.materials else None,
    )
