"""Generate carved rocks for randomised scenes."""

from pathlib import Path

from polarsim.analog.generate import carve_rocks
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    carve_rocks(
        number=snakemake.params.number,
        terrain=snakemake.params.terrain,
        seed=snakemake.params.seed,
        meshes=Path(snakemake.output.meshes),
    )
