"""Masks of the cover photos of a fold's terrains, by its detectors."""

from polarsim.detect.masks import segment_pictures
from polarsim.job import job

with job(snakemake) as call:
    call(segment_pictures)
