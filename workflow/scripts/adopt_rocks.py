"""Clean the published rock meshes of a terrain and fit a ground mesh."""

from pathlib import Path

from polarsim.photo import parse_terrain
from polarsim.reporting import reporting
from polarsim.rocks.adopt import adopt_rocks
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    adopt_rocks(
        site=Site(**snakemake.params.site),
        terrain=parse_terrain(snakemake.wildcards.terrain),
        inventory=Path(snakemake.input.inventory),
        cameras=Path(snakemake.input.cameras),
        rocks=Path(snakemake.output.rocks),
        cuboids=Path(snakemake.output.cuboids),
        meshes=Path(snakemake.output.meshes),
    )
