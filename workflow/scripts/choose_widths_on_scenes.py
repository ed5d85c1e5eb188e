"""Choose the widths at which a detector finds most in scenes that it has not seen."""

from polarsim.covers.widths import choose_on_scenes
from polarsim.job import job

with job(snakemake) as call:
    call(choose_on_scenes)
