"""Cut windows of the front camera's pictures of drives to fine-tune a detector on."""

from polarsim.job import job
from polarsim.rover.onboard.fine_tuning import make_drive_dataset

with job(snakemake) as call:
    call(make_drive_dataset)
