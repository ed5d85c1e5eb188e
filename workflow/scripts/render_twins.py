"""Render and label the twins of a terrain with every reflectance model."""

from pathlib import Path

from polarsim.grid import GridOptions, selected_grid
from polarsim.job_files import list_of_paths, optional_path
from polarsim.photo import parse_terrain
from polarsim.render.options import RenderOptions
from polarsim.render.twins import LabelPaths, render_twins
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    render_twins(
        site=Site(**snakemake.params.site),
        terrain=parse_terrain(snakemake.wildcards.terrain),
        keys=selected_grid(
            site=Site(**snakemake.params.site),
            terrain=parse_terrain(snakemake.wildcards.terrain),
            positions=snakemake.params.positions,
            grid=GridOptions(**snakemake.params.grid),
        ),
        cameras=Path(snakemake.input.cameras),
        meshes=Path(snakemake.input.meshes),
        photos=optional_path(snakemake.input.photos),
        twins=dict(zip(snakemake.params.models, list_of_paths(snakemake.output.twins), strict=True)),
        labels=LabelPaths(
            boxes=Path(snakemake.output.boxes),
            instances=Path(snakemake.output.instances),
            annotations=Path(snakemake.output.annotations),
            table=Path(snakemake.output.table),
            maps=optional_path(snakemake.output.maps),
        ),
        options=RenderOptions(**snakemake.params.options),
        threads=snakemake.threads,
        materials=optional_path(snakemake.input.materials),
        light=optional_path(snakemake.input.light),
    )
