"""Train the detector on board on pictures of other drives."""

from polarsim.job import job
from polarsim.rover.onboard.fine_tuning import fine_tune

with job(snakemake) as call:
    call(fine_tune)
