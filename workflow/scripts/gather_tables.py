"""Concatenate the tables of all splits and seeds."""

from pathlib import Path

from polarsim.detect.evaluate import gather_tables
from polarsim.job_files import list_of_paths
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    gather_tables(
        parts={name: list_of_paths(files) for name, files in snakemake.input.items()},
        gathered={name: Path(file) for name, file in snakemake.output.items()},
        splits=snakemake.params.splits,
        seeds=snakemake.params.seeds,
    )
