"""Render randomised scenes with the rocks of a terrain."""

from pathlib import Path

from polarsim.photo import parse_terrain
from polarsim.reporting import reporting
from polarsim.scenes.options import SceneOptions
from polarsim.scenes.render_scenes import render_scenes

with reporting(log=snakemake.log[0]):
    render_scenes(
        terrain=parse_terrain(snakemake.wildcards.terrain),
        meshes=Path(snakemake.input.meshes),
        pictures=Path(snakemake.output.pictures),
        number=snakemake.params.number,
        stored_px=snakemake.params.stored_px,
        options=SceneOptions(**snakemake.params.options),
        threads=snakemake.threads,
    )
