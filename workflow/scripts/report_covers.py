"""Tabulate scores on cover photos; draw cover photos with detections, and training scenes."""

from pathlib import Path

from polarsim.job_files import list_of_paths
from polarsim.report.covers_table import tabulate_covers
from polarsim.report.figures.covers import draw_covers
from polarsim.report.figures.scenes import draw_scenes
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    tabulate_covers(
        scores=list_of_paths(snakemake.input.scores),
        stem=Path(snakemake.output.covers).with_suffix(""),
        origin=snakemake.params.origin,
    )
    draw_covers(
        photos=Path(snakemake.input.photos),
        labels=Path(snakemake.input.labels),
        predictions=Path(snakemake.input.predictions),
        figure=Path(snakemake.output.covers_figure),
    )
    draw_scenes(
        scenes=dict(zip(snakemake.params.terrains, list_of_paths(snakemake.input.scenes), strict=True)),
        figure=Path(snakemake.output.scenes_figure),
    )
