"""Segment the scans of a terrain into rocks and ground."""

from pathlib import Path

from polarsim.job_files import optional_path
from polarsim.photo import parse_terrain
from polarsim.reporting import reporting
from polarsim.rocks.find import find_rocks
from polarsim.rocks.options import RocksOptions
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    find_rocks(
        site=Site(**snakemake.params.site),
        terrain=parse_terrain(snakemake.wildcards.terrain),
        inventory=Path(snakemake.input.inventory),
        cameras=Path(snakemake.input.cameras),
        seeds=Path(snakemake.input.seeds),
        overrides=optional_path(snakemake.input.overrides),
        rocks=Path(snakemake.output.rocks),
        cuboids=Path(snakemake.output.cuboids),
        ids=Path(snakemake.output.ids),
        clouds=Path(snakemake.output.clouds),
        options=RocksOptions(**snakemake.params.options),
        from_photos=snakemake.params.from_photos,
    )
