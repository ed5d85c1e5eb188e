"""Mix the data sets of several domains."""

from pathlib import Path

from polarsim.detect.dataset import mix_datasets
from polarsim.job import job

with job(snakemake) as call:
    call(
        mix_datasets,
        domain=snakemake.wildcards.mix,
        datasets={Path(path).name: path for path in snakemake.input.datasets},
    )
