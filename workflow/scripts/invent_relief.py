"""Add invented relief to the ground of a terrain."""

from pathlib import Path

from polarsim.cover_photos.control import invent_relief
from polarsim.photo import parse_terrain
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    invent_relief(
        terrain=parse_terrain(snakemake.wildcards.terrain),
        meshes=Path(snakemake.input.meshes),
        control=Path(snakemake.output.control),
        seed=snakemake.params.seed,
    )
