"""Draw what one detector finds in photo and twins."""

from pathlib import Path

from polarsim.report.figures.finds import draw_finds
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    domains = snakemake.params.domains
    draw_finds(
        trained=snakemake.wildcards.trained,
        photo_domain=snakemake.params.photo_domain,
        pictures=map(Path, snakemake.input.pictures),
        instances=Path(snakemake.input.instances),
        ipd=Path(snakemake.input.ipd),
        predictions=dict(zip(domains, map(Path, snakemake.input.predictions), strict=True)),
        labels=dict(zip(domains, map(Path, snakemake.input.labels), strict=True)),
        seen=Path(snakemake.output.seen),
        gap_rocks=Path(snakemake.output.gap_rocks),
        origin=snakemake.params.origin,
    )
