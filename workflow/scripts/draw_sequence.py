"""Draw images at several times of a drive."""

from pathlib import Path

from polarsim.report.figures.drive_images import draw_sequence
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    draw_sequence(
        view=Path(snakemake.input.poses).parent,
        pictures=snakemake.params.pictures,
        figure=Path(snakemake.output.figure),
    )
