"""Tabulate the diameters of rocks by detections."""

from pathlib import Path

from polarsim.job_files import list_of_paths
from polarsim.report.rock_diameters import report_rock_diameters
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    report_rock_diameters(
        diameters=Path(snakemake.input.diameters),
        areas=dict(zip(snakemake.params.terrains, list_of_paths(snakemake.input.areas), strict=True)),
        table=Path(snakemake.output.rock_diameters).with_suffix(""),
        origin=snakemake.params.origin,
    )
