"""Score what detectors find in the cover photos of terrains that they have not seen."""

from pathlib import Path

from polarsim.covers.scores import score_covers
from polarsim.detect.options import ComparisonOptions, TrainingOptions
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    score_covers(
        labels=Path(snakemake.input.labels),
        predictions=dict(
            zip(map(tuple, snakemake.params.trainings), map(Path, snakemake.input.predictions), strict=True)
        ),
        datasets=dict(zip(snakemake.params.folds, map(Path, snakemake.input.datasets), strict=True)),
        scores=Path(snakemake.output.scores),
        training=TrainingOptions(**snakemake.params.training),
        options=ComparisonOptions(**snakemake.params.options),
    )
