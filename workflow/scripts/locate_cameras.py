"""Find where the rig stood at every position of one terrain."""

from polarsim.cameras.locate import locate_cameras
from polarsim.job import job

with job(snakemake) as call:
    call(locate_cameras)
