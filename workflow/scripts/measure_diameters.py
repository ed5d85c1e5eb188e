"""Measure rocks by detections in photos."""

from pathlib import Path

from polarsim.detect.rock_diameters import measure_diameters
from polarsim.job_files import list_of_paths
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    measure_diameters(
        predictions=Path(snakemake.input.predictions),
        cameras=dict(zip(snakemake.params.terrains, list_of_paths(snakemake.input.cameras), strict=True)),
        diameters=Path(snakemake.output.diameters),
    )
