"""Score one terrain's cameras."""

from pathlib import Path

from polarsim.job_files import optional_path
from polarsim.reporting import reporting
from polarsim.scoring.cameras import score_cameras

with reporting(log=snakemake.log[0]):
    score_cameras(
        terrain=int(snakemake.wildcards.terrain),
        cameras=Path(snakemake.input.cameras),
        truth=optional_path(snakemake.params.truth),
        matches=Path(snakemake.input.cameras) / "matches.parquet",
        annotated=optional_path(snakemake.params.annotated),
        meshes=Path(snakemake.input.meshes),
        evaluation=Path(snakemake.output.evaluation),
    )
