"""Mix the data sets of several domains."""

from pathlib import Path

from polarsim.detect.dataset import mix_datasets
from polarsim.detect.options import SplitOptions
from polarsim.job_files import list_of_paths
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    mix_datasets(
        domain=snakemake.wildcards.mix,
        weights=snakemake.params.weights,
        datasets={path.name: path for path in list_of_paths(snakemake.input.datasets)},
        dataset=Path(snakemake.output.dataset),
        options=SplitOptions(**snakemake.params.options),
    )
