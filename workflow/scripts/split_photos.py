"""Split the photos of a run into parts."""

from polarsim.detect.split import split_photos
from polarsim.grid import selected_grids
from polarsim.job import job

with job(snakemake) as call:
    call(split_photos, keys=call(selected_grids), by=snakemake.wildcards.split)
