"""Score the cameras, rocks and meshes of a terrain."""

from pathlib import Path

from polarsim.job_files import optional_path
from polarsim.photo import parse_terrain
from polarsim.reporting import reporting
from polarsim.scoring.cameras import score_cameras
from polarsim.scoring.consistency import check_consistency
from polarsim.scoring.rocks import score_rocks
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    score_cameras(
        site=Site(**snakemake.params.site),
        terrain=parse_terrain(snakemake.wildcards.terrain),
        cameras=Path(snakemake.input.cameras),
        truth=optional_path(snakemake.params.truth),
        matches=Path(snakemake.input.cameras) / "matches.parquet",
        annotated=optional_path(snakemake.params.annotated),
        meshes=Path(snakemake.input.meshes),
        evaluation=Path(snakemake.output.cameras),
    )
    score_rocks(
        site=Site(**snakemake.params.site),
        terrain=parse_terrain(snakemake.wildcards.terrain),
        rocks=Path(snakemake.input.rocks),
        meshes=Path(snakemake.input.meshes),
        located=Path(snakemake.input.located),
        cameras=Path(snakemake.input.cameras),
        truth=optional_path(snakemake.params.truth),
        inventory=Path(snakemake.input.inventory),
        evaluation=Path(snakemake.output.rocks),
        scores=Path(snakemake.output.meshes),
        offsets=Path(snakemake.output.offsets),
    )
    check_consistency(
        site=Site(**snakemake.params.site),
        terrain=parse_terrain(snakemake.wildcards.terrain),
        inventory=Path(snakemake.input.inventory),
        located=Path(snakemake.input.located),
        cameras=Path(snakemake.input.cameras),
        meshes=Path(snakemake.input.meshes),
        photos=optional_path(snakemake.input.photos),
        annotated=optional_path(snakemake.params.annotated),
        evaluation=Path(snakemake.output.consistency),
    )
