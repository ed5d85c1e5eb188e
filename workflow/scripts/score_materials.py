"""Score the fitted materials of a terrain."""

from pathlib import Path

from polarsim.photo import parse_terrain
from polarsim.reporting import reporting
from polarsim.scoring.materials import score_materials
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    score_materials(
        site=Site(**snakemake.params.site),
        terrain=parse_terrain(snakemake.wildcards.terrain),
        materials=Path(snakemake.input.materials),
        meshes=Path(snakemake.input.meshes),
        cameras=Path(snakemake.input.cameras),
        truth=Path(snakemake.params.truth),
        evaluation=Path(snakemake.output.evaluation),
    )
