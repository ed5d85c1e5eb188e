"""Let the rover find its way once."""

from pathlib import Path

from polarsim.job import job
from polarsim.rover.autonomy.table import drive_case

with job(snakemake) as call:
    call(drive_case, meshes=Path(snakemake.input.meshes[0]).parent, folder=Path(snakemake.output.figures).parent)
