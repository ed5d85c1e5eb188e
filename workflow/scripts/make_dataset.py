"""Share the pictures of one domain out to the parts of a split."""

from polarsim.detect.dataset import share_pictures
from polarsim.job import job

with job(snakemake) as call:
    call(share_pictures, by=snakemake.wildcards.split)
