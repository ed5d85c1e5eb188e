"""Find the true sizes of measured rocks."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.scoring.rock_sizes import find_true_sizes

with reporting(log=snakemake.log[0]):
    find_true_sizes(
        terrain=int(snakemake.wildcards.terrain),
        sizes=Path(snakemake.input.sizes),
        rocks=Path(snakemake.input.rocks),
        located=Path(snakemake.input.located),
        truth=Path(snakemake.params.truth),
        true_sizes=Path(snakemake.output.true_sizes),
    )
