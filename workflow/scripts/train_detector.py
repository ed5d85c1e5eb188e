"""Train a detector on one domain or mix."""

from polarsim.detect.train import train_detector
from polarsim.job import job

with job(snakemake) as call:
    call(train_detector)
