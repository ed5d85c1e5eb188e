"""Score one terrain's twins."""

from polarsim.job import job
from polarsim.scoring.twins import score_twins

with job(snakemake) as call:
    call(score_twins, twins=dict(zip(snakemake.params.models, snakemake.input.twins, strict=True)))
