"""Mesh the rocks and ground of a terrain."""

from pathlib import Path

from polarsim.photo import parse_terrain
from polarsim.reporting import reporting
from polarsim.rocks.mesh import mesh_rocks
from polarsim.rocks.options import RocksOptions
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    mesh_rocks(
        site=Site(**snakemake.params.site),
        terrain=parse_terrain(snakemake.wildcards.terrain),
        rocks=Path(snakemake.input.rocks),
        clouds=Path(snakemake.input.clouds),
        meshes=Path(snakemake.output.meshes),
        options=RocksOptions(**snakemake.params.options),
        from_photos=snakemake.params.from_photos,
    )
