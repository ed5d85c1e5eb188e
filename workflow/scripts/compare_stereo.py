"""Stereo depth of all terrains, and its IPD."""

from polarsim.detect.stereo.compare import compare_stereo
from polarsim.job import job

with job(snakemake) as call:
    call(compare_stereo)
