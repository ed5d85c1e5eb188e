"""Score one terrain's fitted materials."""

from polarsim.job import job
from polarsim.scoring.materials import score_materials

with job(snakemake) as call:
    call(score_materials)
