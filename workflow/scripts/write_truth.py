"""Move one terrain's truth into the frame of the run."""

from polarsim.job import job
from polarsim.scoring.true_scene import write_truth

with job(snakemake) as call:
    call(write_truth)
