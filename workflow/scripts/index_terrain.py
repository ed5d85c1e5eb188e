"""Index the raw data of a terrain."""

from pathlib import Path

from polarsim.acquire.index import index_terrain
from polarsim.acquire.options import SourceOptions, seed_choice
from polarsim.grid import GridOptions
from polarsim.photo import parse_terrain
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    index_terrain(
        site=Site(**snakemake.params.site),
        terrain=parse_terrain(snakemake.wildcards.terrain),
        positions=snakemake.params.positions,
        source=SourceOptions(**snakemake.params.source),
        seed_options=seed_choice(snakemake.params.seed_options),
        photos=Path(snakemake.output.photos),
        calibration=Path(snakemake.output.calibration),
        inventory=Path(snakemake.output.inventory),
        seeds=Path(snakemake.output.seeds),
        converted=snakemake.output.get("converted"),
        grid=GridOptions(**snakemake.params.grid),
    )
