"""Draw what one detector finds in photo and twins."""

from pathlib import Path

from polarsim.job_files import paths
from polarsim.report.figures.finds import draw_finds
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    draw_finds(
        trained=snakemake.wildcards.trained,
        photo_domain=snakemake.params.photo_domain,
        pictures=paths(snakemake.input.pictures),
        instances=Path(snakemake.input.instances),
        ipd=Path(snakemake.input.ipd),
        predictions=dict(zip(snakemake.params.domains, paths(snakemake.input.predictions), strict=True)),
        labels=dict(zip(snakemake.params.domains, paths(snakemake.input.labels), strict=True)),
        seen=Path(snakemake.output.seen),
        gap_rocks=Path(snakemake.output.gap_rocks),
        origin=snakemake.params.origin,
    )
