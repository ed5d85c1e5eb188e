"""Score what detectors find in the cover photos of terrains that they have not seen."""

from polarsim.covers.scores import score_covers
from polarsim.job import job

with job(snakemake) as call:
    call(
        score_covers,
        trained=snakemake.wildcards.cover_trained,
        predictions=dict(zip(snakemake.params.seeds, snakemake.input.predictions, strict=True)),
        datasets=dict(zip(snakemake.params.folds, snakemake.input.datasets, strict=True)),
    )
