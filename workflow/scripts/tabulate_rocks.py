"""Tabulate rocks and meshes of all terrains."""

from pathlib import Path

from polarsim.job_files import paths
from polarsim.report.stage_tables import tabulate_rocks
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    tabulate_rocks(
        rocks=dict(zip(snakemake.params.terrains, paths(snakemake.input.rocks), strict=True)),
        scores=dict(zip(snakemake.params.terrains, paths(snakemake.input.scores), strict=True)),
        table=Path(snakemake.output.table).with_suffix(""),
        meshes=Path(snakemake.output.meshes).with_suffix(""),
        origin=snakemake.params.origin,
    )
