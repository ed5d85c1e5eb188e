"""Merge what each fold's detectors of all seeds see in its cover photos."""

from polarsim.covers.merging import merge_seeds
from polarsim.job import job

with job(snakemake) as call:
    call(merge_seeds)
