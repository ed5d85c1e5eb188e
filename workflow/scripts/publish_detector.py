"""Write the detector of all terrains with its widths, its calibration and its card."""

from polarsim.covers.publish import publish_detector
from polarsim.job import job

with job(snakemake) as call:
    folds = snakemake.params.folds
    call(
        publish_detector,
        found=dict(zip(folds, snakemake.input.found, strict=True)),
        datasets=dict(zip(folds, snakemake.input.datasets, strict=True)),
        sized=dict(zip(folds, snakemake.input.sized, strict=False)),  # none where widths are chosen on photos
    )
