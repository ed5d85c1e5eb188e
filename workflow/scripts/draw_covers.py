"""Draw cover photos with labels and detections."""

from pathlib import Path

from polarsim.report.figures.covers import draw_covers
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    draw_covers(
        photos=Path(snakemake.input.photos),
        labels=Path(snakemake.input.labels),
        predictions=Path(snakemake.input.predictions),
        figure=Path(snakemake.output.figure),
    )
