"""Tabulate cameras, alignments, rocks and meshes of all terrains."""

from pathlib import Path

from polarsim.job_files import list_of_paths
from polarsim.report.stage_tables import tabulate_cameras, tabulate_rocks
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    tabulate_cameras(
        cameras=dict(zip(snakemake.params.terrains, list_of_paths(snakemake.input.cameras), strict=True)),
        evaluation=list_of_paths(snakemake.input.evaluation),
        table=Path(snakemake.output.cameras).with_suffix(""),
        alignment=Path(snakemake.output.alignment).with_suffix(""),
        origin=snakemake.params.origin,
    )
    tabulate_rocks(
        rocks=dict(zip(snakemake.params.terrains, list_of_paths(snakemake.input.rocks), strict=True)),
        scores=dict(zip(snakemake.params.terrains, list_of_paths(snakemake.input.mesh_scores), strict=True)),
        table=Path(snakemake.output.rocks).with_suffix(""),
        meshes=Path(snakemake.output.meshes).with_suffix(""),
        origin=snakemake.params.origin,
    )
