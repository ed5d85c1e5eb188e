"""Score masks of cover photos against the polygons that people drew of them."""

from polarsim.job import job
from polarsim.scoring.masks import score_masks

with job(snakemake) as call:
    call(score_masks)
