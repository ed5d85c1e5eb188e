"""Measure the rocks of a terrain."""

from pathlib import Path

from polarsim.job_files import optional_path
from polarsim.photo import parse_terrain
from polarsim.reporting import reporting
from polarsim.rocks.sizes import measure_rocks
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    measure_rocks(
        site=Site(**snakemake.params.site),
        terrain=parse_terrain(snakemake.wildcards.terrain),
        meshes=Path(snakemake.input.meshes),
        clouds=optional_path(snakemake.input.clouds),
        sizes=Path(snakemake.output.sizes),
        area=Path(snakemake.output.area),
    )
