"""Write the detector of all terrains with widths, calibration and model card."""

from pathlib import Path

from polarsim.cover_photos.publish import publish_detector
from polarsim.detect.options import PredictionOptions
from polarsim.job_files import list_of_paths
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    publish_detector(
        weights=Path(snakemake.input.weights),
        labels=Path(snakemake.input.labels),
        found=dict(zip(snakemake.params.folds, list_of_paths(snakemake.input.found), strict=True)),
        datasets=dict(zip(snakemake.params.folds, list_of_paths(snakemake.input.datasets), strict=True)),
        scores=Path(snakemake.input.scores),
        detector=Path(snakemake.output.detector),
        card=Path(snakemake.output.card),
        width=Site(**snakemake.params.site).images.width,
        options=PredictionOptions(**snakemake.params.options),
    )
