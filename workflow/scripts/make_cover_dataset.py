"""Share scenes and cover photos out to the parts of one fold's data set."""

from polarsim.covers.dataset import make_cover_dataset
from polarsim.job import job

with job(snakemake) as call:
    scenes = dict(zip(snakemake.params.train, snakemake.input.scenes, strict=True))
    call(make_cover_dataset, scenes=scenes)
