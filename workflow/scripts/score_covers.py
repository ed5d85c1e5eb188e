"""Score detections in cover photos of test terrains."""

from pathlib import Path

from polarsim.cover_photos.scores import score_covers
from polarsim.detect.options import ComparisonOptions, TrainingOptions
from polarsim.job_files import list_of_paths, optional_path
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    score_covers(
        labels=Path(snakemake.input.labels),
        predictions=dict(zip(snakemake.params.seeds, list_of_paths(snakemake.input.predictions), strict=True)),
        merged=optional_path(snakemake.input.merged),
        datasets=dict(zip(snakemake.params.folds, list_of_paths(snakemake.input.datasets), strict=True)),
        trained_on=list_of_paths(snakemake.input.trained_on),
        scores=Path(snakemake.output.scores),
        trained=snakemake.wildcards.cover_trained,
        training=TrainingOptions(**snakemake.params.training),
        start=snakemake.params.start,
        options=ComparisonOptions(**snakemake.params.options),
    )
