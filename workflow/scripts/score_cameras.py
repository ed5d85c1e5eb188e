"""Score one terrain's cameras."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.scoring.cameras import score_cameras

with reporting(log=snakemake.log[0]):
    score_cameras(
        terrain=int(snakemake.wildcards.terrain),
        cameras=Path(snakemake.input.cameras),
        truth=Path(snakemake.params.truth) if snakemake.params.truth else None,
        matches=Path(snakemake.input.cameras) / "matches.parquet",
        annotated=Path(snakemake.params.annotated) if snakemake.params.annotated else None,
        meshes=Path(snakemake.input.meshes),
        evaluation=Path(snakemake.output.evaluation),
    )
