"""Draw front camera images with rocks and detections."""

from pathlib import Path

from polarsim.job_files import optional_path
from polarsim.report.figures.drive_images import draw_front
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    draw_front(
        view=Path(snakemake.input.poses).parent,
        pictures=snakemake.params.pictures,
        truth=Path(snakemake.input.truth),
        detections=optional_path(snakemake.input.detections),
        confidence=snakemake.params.confidence,
        figure=Path(snakemake.output.figure),
    )
