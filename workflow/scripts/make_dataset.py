"""Make the data set of one domain."""

from pathlib import Path

from polarsim.detect.dataset import make_dataset
from polarsim.detect.options import DetectOptions
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    make_dataset(
        domain=snakemake.wildcards.domain,
        pictures=Path(snakemake.params.pictures),
        labels=Path(snakemake.input.labels[0]),
        split=Path(snakemake.input.split),
        dataset=Path(snakemake.output.dataset),
        options=DetectOptions(**snakemake.params.options),
    )
