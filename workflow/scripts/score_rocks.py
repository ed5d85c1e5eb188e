"""Score one terrain's rocks and meshes."""

from polarsim.job import job
from polarsim.scoring.rocks import score_rocks

with job(snakemake) as call:
    call(score_rocks)
