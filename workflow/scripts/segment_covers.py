"""Predict masks of the cover photos of a fold."""

from pathlib import Path

from polarsim.detect.masks import segment_pictures
from polarsim.detect.options import PredictionOptions
from polarsim.job_files import list_of_paths
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    segment_pictures(
        weights=list_of_paths(snakemake.input.weights),
        dataset=Path(snakemake.input.dataset),
        masks=Path(snakemake.output.masks),
        size=Site(**snakemake.params.site).images.size,
        options=PredictionOptions(**snakemake.params.options),
        threads=snakemake.threads,
    )
