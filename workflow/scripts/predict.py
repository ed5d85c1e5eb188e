"""Ask a detector of one domain about the test pictures of every domain."""

from pathlib import Path

from polarsim.detect.options import PredictionOptions
from polarsim.detect.predict import predict
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    for dataset, predictions in zip(snakemake.input.datasets, snakemake.output.predictions, strict=True):
        predict(
            weights=Path(snakemake.input.weights),
            dataset=Path(dataset),
            predictions=Path(predictions),
            options=PredictionOptions(**snakemake.params.options),
            threads=snakemake.threads,
        )
