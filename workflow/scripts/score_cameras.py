"""Score one terrain's cameras."""

from polarsim.job import job
from polarsim.scoring.cameras import score_cameras

with job(snakemake) as call:
    call(score_cameras, matches=f"{snakemake.input.cameras}/matches.parquet")
