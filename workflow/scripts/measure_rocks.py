"""Measure the rocks of a terrain."""

from pathlib import Path

from polarsim.job_files import optional_path
from polarsim.reporting import reporting
from polarsim.rocks.sizes import measure_rocks

with reporting(log=snakemake.log[0]):
    measure_rocks(
        terrain=int(snakemake.wildcards.terrain),
        meshes=Path(snakemake.input.meshes),
        clouds=optional_path(snakemake.input.clouds),
        sizes=Path(snakemake.output.sizes),
        area=Path(snakemake.output.area),
    )
