"""Score one terrain's labels."""

from polarsim.grid import selected_grid
from polarsim.job import job
from polarsim.scoring.labels import score_labels

with job(snakemake) as call:
    call(score_labels, keys=call(selected_grid))
