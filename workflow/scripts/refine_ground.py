"""Refine the ground of a terrain by photos."""

from pathlib import Path

from polarsim.photo import parse_terrain
from polarsim.relief.refine import refine_ground
from polarsim.render.options import RenderOptions
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    refine_ground(
        site=Site(**snakemake.params.site),
        terrain=parse_terrain(snakemake.wildcards.terrain),
        meshes=Path(snakemake.input.meshes),
        cameras=Path(snakemake.input.cameras),
        photos=Path(snakemake.input.photos),
        refined=Path(snakemake.output.meshes),
        options=RenderOptions(**snakemake.params.options),
    )
