"""Ask a judge of one domain about the test pictures of another."""

from pathlib import Path

from polarsim.detect.options import DetectOptions
from polarsim.detect.predict import predict
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    predict(
        weights=Path(snakemake.input.weights),
        dataset=Path(snakemake.input.dataset),
        predictions=Path(snakemake.output.predictions),
        options=DetectOptions(**snakemake.params.options),
        threads=snakemake.threads,
    )
