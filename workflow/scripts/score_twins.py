"""Score the twins of a terrain."""

from pathlib import Path

from polarsim.job_files import list_of_paths, optional_path
from polarsim.photo import parse_terrain
from polarsim.reporting import reporting
from polarsim.scoring.twins import score_twins
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    score_twins(
        site=Site(**snakemake.params.site),
        terrain=parse_terrain(snakemake.wildcards.terrain),
        boxes=Path(snakemake.input.boxes),
        truth=optional_path(snakemake.params.truth),
        twins=dict(zip(snakemake.params.models, list_of_paths(snakemake.input.twins), strict=True)),
        others=dict(zip(snakemake.params.models, list_of_paths(snakemake.input.others), strict=False)),
        materials=optional_path(snakemake.input.materials),
        light=optional_path(snakemake.input.light),
        meshes=Path(snakemake.input.meshes),
        photos=Path(snakemake.input.photos),
        covers=optional_path(snakemake.input.covers),
        drawn=optional_path(snakemake.input.drawn),
        instances=Path(snakemake.input.instances),
        evaluation=Path(snakemake.output.evaluation),
        appearance=Path(snakemake.output.appearance),
    )
