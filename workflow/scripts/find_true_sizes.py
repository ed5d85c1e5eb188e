"""Find the true sizes of measured rocks."""

from pathlib import Path

from polarsim.photo import parse_terrain
from polarsim.reporting import reporting
from polarsim.scoring.rock_sizes import find_true_sizes
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    find_true_sizes(
        site=Site(**snakemake.params.site),
        terrain=parse_terrain(snakemake.wildcards.terrain),
        sizes=Path(snakemake.input.sizes),
        rocks=Path(snakemake.input.rocks),
        located=Path(snakemake.input.located),
        truth=Path(snakemake.params.truth),
        true_sizes=Path(snakemake.output.true_sizes),
    )
