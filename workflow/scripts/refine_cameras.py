"""Refine one terrain's rig poses, lenses and lamps on its photos."""

from polarsim.cameras.photos import refine_cameras
from polarsim.job import job

with job(snakemake) as call:
    call(refine_cameras)
