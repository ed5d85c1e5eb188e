"""Tabulate cameras and alignments of all terrains."""

from pathlib import Path

from polarsim.job_files import paths
from polarsim.report.stage_tables import tabulate_cameras
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    tabulate_cameras(
        cameras=dict(zip(snakemake.params.terrains, paths(snakemake.input.cameras), strict=True)),
        evaluation=paths(snakemake.input.evaluation),
        table=Path(snakemake.output.table).with_suffix(""),
        alignment=Path(snakemake.output.alignment).with_suffix(""),
        origin=snakemake.params.origin,
    )
