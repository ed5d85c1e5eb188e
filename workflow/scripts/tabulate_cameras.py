"""Tabulate cameras and alignments of all terrains."""

from polarsim.job import job
from polarsim.report.stage_tables import tabulate_cameras

with job(snakemake) as call:
    call(
        tabulate_cameras,
        cameras=dict(zip(snakemake.params.terrains, snakemake.input.cameras, strict=True)),
        table=snakemake.output.table.removesuffix(".csv"),
        alignment=snakemake.output.alignment.removesuffix(".csv"),
    )
