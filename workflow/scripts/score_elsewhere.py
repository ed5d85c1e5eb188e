"""Evaluate the packaged detector on images from outside POLAR."""

from pathlib import Path

from polarsim.annotate.detections import draw_detections
from polarsim.detect.detect_pictures import prediction_options
from polarsim.detect.elsewhere import score_elsewhere
from polarsim.detect.options import PACKAGED, PACKAGED_FIELD
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    score_elsewhere(
        name=snakemake.wildcards.name,
        folder=Path(snakemake.input.folder),
        weights=PACKAGED,
        weights_elsewhere=PACKAGED_FIELD,
        detections=Path(snakemake.output.detections),
        scores=Path(snakemake.output.scores),
        options=prediction_options([], [], "cpu"),
        resamples=snakemake.params.resamples,
        draw=draw_detections,
    )
