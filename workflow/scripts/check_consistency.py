"""Hold one terrain's scans, cameras, meshes and boxes against each other."""

from polarsim.job import job
from polarsim.scoring.consistency import check_consistency

with job(snakemake) as call:
    call(check_consistency)
