"""Share windows of cover photos and pictures of scenes out to the parts of one fold's data set for fine-tuning."""

from polarsim.covers.dataset import make_fine_tuning_dataset
from polarsim.job import job

with job(snakemake) as call:
    scenes = dict(zip(snakemake.params.train, snakemake.input.scenes, strict=True))
    call(make_fine_tuning_dataset, scenes=scenes)
