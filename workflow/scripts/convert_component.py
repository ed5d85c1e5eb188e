"""Convert the test pictures of a component's twins."""

from pathlib import Path

from polarsim.detect.dataset import make_dataset
from polarsim.detect.split import TEST
from polarsim.job import job

with job(snakemake) as call:
    call(
        make_dataset,
        domain=snakemake.wildcards.component,
        pictures=Path(snakemake.input.pictures[0]).parent,
        by=snakemake.wildcards.split,
        wanted=[TEST],
    )
