"""Write the detector of scenes beyond the sandbox with widths, calibration and model card."""

from pathlib import Path

from polarsim.cover_photos.field import publish_field_detector
from polarsim.detect.options import PredictionOptions
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    publish_field_detector(
        weights=Path(snakemake.input.weights),
        dataset=Path(snakemake.input.dataset),
        detector=Path(snakemake.output.detector),
        card=Path(snakemake.output.card),
        options=PredictionOptions(**snakemake.params.options),
        threads=snakemake.threads,
    )
