"""Clean the published rock meshes of a terrain and fit a ground mesh."""

from pathlib import Path

from polarsim.photo import parse_terrain
from polarsim.reporting import reporting
from polarsim.rocks.adopt import adopt_rocks

with reporting(log=snakemake.log[0]):
    adopt_rocks(
        terrain=parse_terrain(snakemake.wildcards.terrain),
        inventory=Path(snakemake.input.inventory),
        cameras=Path(snakemake.input.cameras),
        rocks=Path(snakemake.output.rocks),
        cuboids=Path(snakemake.output.cuboids),
        meshes=Path(snakemake.output.meshes),
    )
