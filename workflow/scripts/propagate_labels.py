"""Carry one terrain's seed labels to every photo."""

from polarsim.grid import selected_grid
from polarsim.job import job
from polarsim.labels.propagate import propagate_labels

with job(snakemake) as call:
    call(propagate_labels, keys=call(selected_grid))
