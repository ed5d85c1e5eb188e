"""Draw a photo beside its twins."""

from polarsim.job import job
from polarsim.photo import PhotoKey
from polarsim.report.figures.comparison import draw_comparison

with job(snakemake) as call:
    call(
        draw_comparison,
        key=PhotoKey.parse(snakemake.params.key),
        twins=dict(zip(snakemake.params.models, snakemake.input.twins, strict=True)),
    )
