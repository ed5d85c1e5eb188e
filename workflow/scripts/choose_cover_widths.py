"""Choose the widths at which every fold's detector looks at its photos, without these photos."""

from polarsim.covers.widths import choose_widths
from polarsim.job import job

with job(snakemake) as call:
    folds = snakemake.params.folds
    call(
        choose_widths,
        found=dict(zip(folds, snakemake.input.found, strict=True)),
        datasets=dict(zip(folds, snakemake.input.datasets, strict=True)),
        sized=dict(zip(folds, snakemake.input.sized, strict=False)),  # none where widths are chosen on photos
    )
