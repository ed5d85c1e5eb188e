"""Rank the detectors that drove by their gap and by their drives."""

from polarsim.job import job
from polarsim.rover.autonomy.rank import rank_detectors

with job(snakemake) as call:
    call(rank_detectors)
