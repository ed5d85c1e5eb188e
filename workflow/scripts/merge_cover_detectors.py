"""Merge the predictions of the detectors of all seeds in each fold."""

from pathlib import Path

from polarsim.cover_photos.widths import merge_seeds
from polarsim.detect.options import PredictionOptions
from polarsim.job_files import list_of_paths
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    merge_seeds(
        predictions=list_of_paths(snakemake.input.predictions),
        merged=Path(snakemake.output.merged),
        options=PredictionOptions(**snakemake.params.options),
    )
