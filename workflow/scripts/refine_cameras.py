"""Refine rig poses, lenses and lamps of a terrain with photos."""

from pathlib import Path

from polarsim.cameras.options import RefinementOptions
from polarsim.cameras.photos import refine_cameras
from polarsim.job_files import optional_path
from polarsim.photo import parse_terrain
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    refine_cameras(
        site=Site(**snakemake.params.site),
        terrain=parse_terrain(snakemake.wildcards.terrain),
        located=Path(snakemake.input.located),
        meshes=Path(snakemake.input.meshes),
        photos=optional_path(snakemake.input.photos),
        cameras=Path(snakemake.output.cameras),
        options=RefinementOptions(**snakemake.params.options),
        covers=optional_path(snakemake.input.covers),
        drawn=optional_path(snakemake.input.drawn),
    )
