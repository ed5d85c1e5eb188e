"""Predict with a detector on the cover photos of a fold at several widths."""

from pathlib import Path

from polarsim.cover_photos.widths import predict_multiscale
from polarsim.detect.options import PredictionOptions
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    predict_multiscale(
        weights=Path(snakemake.input.weights),
        dataset=Path(snakemake.input.dataset),
        found=Path(snakemake.output.found),
        size=Site(**snakemake.params.site).images.size,
        widths=snakemake.params.widths,
        options=PredictionOptions(**snakemake.params.options),
        threads=snakemake.threads,
    )
