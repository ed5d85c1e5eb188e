"""Download and unpack the raw data of a terrain."""

from pathlib import Path

from polarsim.acquire.fetch import fetch_terrain
from polarsim.acquire.options import SourceOptions
from polarsim.photo import parse_terrain
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    fetch_terrain(
        site=Site(**snakemake.params.site),
        terrain=parse_terrain(snakemake.wildcards.terrain),
        source=SourceOptions(**snakemake.params.source),
        done=Path(snakemake.output.receipt),
    )
