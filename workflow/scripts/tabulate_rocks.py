"""Tabulate rocks and meshes of all terrains."""

from polarsim.job import job
from polarsim.report.stage_tables import tabulate_rocks

with job(snakemake) as call:
    call(
        tabulate_rocks,
        rocks=dict(zip(snakemake.params.terrains, snakemake.input.rocks, strict=True)),
        scores=dict(zip(snakemake.params.terrains, snakemake.input.scores, strict=True)),
        table=snakemake.output.table.removesuffix(".csv"),
        meshes=snakemake.output.meshes.removesuffix(".csv"),
    )
