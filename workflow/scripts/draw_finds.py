"""Draw what one detector finds in photo and twins."""

from polarsim.job import job
from polarsim.report.figures.finds import draw_finds

with job(snakemake) as call:
    call(
        draw_finds,
        predictions=dict(zip(snakemake.params.domains, snakemake.input.predictions, strict=True)),
        labels=dict(zip(snakemake.params.domains, snakemake.input.labels, strict=True)),
    )
