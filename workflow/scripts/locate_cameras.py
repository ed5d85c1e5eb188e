"""Estimate the rig pose at every position of a terrain."""

from pathlib import Path

from polarsim.cameras.locate import locate_cameras
from polarsim.cameras.options import LocalisationOptions
from polarsim.job_files import optional_path
from polarsim.photo import parse_terrain
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    locate_cameras(
        site=Site(**snakemake.params.site),
        terrain=parse_terrain(snakemake.wildcards.terrain),
        positions=snakemake.params.positions,
        inventory=Path(snakemake.input.inventory),
        calibration=Path(snakemake.input.calibration),
        seeds=Path(snakemake.input.seeds),
        cameras=Path(snakemake.output.cameras),
        options=LocalisationOptions(**snakemake.params.options),
        ranges=optional_path(snakemake.input.ranges),
    )
