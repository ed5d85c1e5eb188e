"""Transform the ground truth of a terrain to the frame of the run."""

from pathlib import Path

from polarsim.photo import parse_terrain
from polarsim.reporting import reporting
from polarsim.scoring.true_scene import write_true_scene
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    write_true_scene(
        site=Site(**snakemake.params.site),
        terrain=parse_terrain(snakemake.wildcards.terrain),
        rocks=Path(snakemake.input.rocks),
        meshes=Path(snakemake.input.meshes),
        located=Path(snakemake.input.located),
        inventory=Path(snakemake.input.inventory),
        truth=Path(snakemake.params.truth),
        true_cameras=Path(snakemake.output.true_cameras),
        true_meshes=Path(snakemake.output.true_meshes),
    )
