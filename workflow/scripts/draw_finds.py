"""Draw the detections of each detector in photos and twins."""

from pathlib import Path

from polarsim.job_files import paths
from polarsim.report.figures.finds import draw_finds
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    draw_finds(
        domains=snakemake.params.domains,
        photo_domain=snakemake.params.photo_domain,
        pictures=paths(snakemake.input.pictures),
        instances=Path(snakemake.input.instances),
        ipd=Path(snakemake.input.ipd),
        predictions=paths(snakemake.input.predictions),
        labels=dict(zip(snakemake.params.domains, paths(snakemake.input.labels), strict=True)),
        seen=paths(snakemake.output.seen),
        gap_rocks=paths(snakemake.output.gap_rocks),
        origin=snakemake.params.origin,
    )
