"""Score one terrain's outlines against the published polygons."""

from polarsim.grid import selected_grid
from polarsim.job import job
from polarsim.scoring.outlines import score_outlines

with job(snakemake) as call:
    call(score_outlines, keys=call(selected_grid))
