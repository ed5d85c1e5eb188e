"""Render the twins of the cover photos of a terrain with invented relief."""

from pathlib import Path

from polarsim.cover_photos.twins import photo_keys
from polarsim.photo import parse_terrain
from polarsim.render.options import RenderOptions
from polarsim.render.twins import LabelPaths, render_twins
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    render_twins(
        site=Site(**snakemake.params.site),
        terrain=parse_terrain(snakemake.wildcards.terrain),
        keys=photo_keys(Path(snakemake.input.photos), parse_terrain(snakemake.wildcards.terrain)),
        cameras=Path(snakemake.input.cameras),
        meshes=Path(snakemake.input.meshes),
        photos=None,
        twins={snakemake.params.model: Path(snakemake.output.twins)},
        labels=LabelPaths(
            boxes=Path(snakemake.output.boxes),
            instances=Path(snakemake.output.instances),
            annotations=Path(snakemake.output.annotations),
            table=Path(snakemake.output.table),
        ),
        options=RenderOptions(**snakemake.params.options),
        threads=snakemake.threads,
    )
