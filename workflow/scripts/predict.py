"""Ask a detector of one domain about the test pictures of every domain."""

from polarsim.detect.predict import predict
from polarsim.job import job

with job(snakemake) as call:
    for dataset, predictions in zip(snakemake.input.datasets, snakemake.output.predictions, strict=True):
        call(predict, dataset=dataset, predictions=predictions)
