"""Copy the ground of a terrain and thin the rocks."""

from pathlib import Path

from polarsim.photo import parse_terrain
from polarsim.reporting import reporting
from polarsim.scoring.true_scene import thin_meshes

with reporting(log=snakemake.log[0]):
    thin_meshes(
        terrain=parse_terrain(snakemake.wildcards.terrain),
        meshes=Path(snakemake.input.meshes),
        thinned=Path(snakemake.output.thinned),
    )
