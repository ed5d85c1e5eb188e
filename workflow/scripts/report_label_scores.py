"""Tabulate and draw the accuracy of labels and the reliability of their confidence."""

from pathlib import Path

from polarsim.job_files import list_of_paths
from polarsim.photo import parse_terrain
from polarsim.report.figures.labels import draw_label_scores
from polarsim.report.labels_table import tabulate_labels
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    tabulate_labels(
        azimuths=Site(**snakemake.params.site).azimuths,
        pairs=list_of_paths(snakemake.input.pairs),
        table=Path(snakemake.output.labels).with_suffix(""),
        reliability=Path(snakemake.output.reliability).with_suffix(""),
        seeds=snakemake.params.seeds,
        origin=snakemake.params.origin,
    )
    draw_label_scores(
        terrains=[parse_terrain(terrain) for terrain in snakemake.params.terrains],
        pairs=list_of_paths(snakemake.input.pairs),
        reliability=Path(snakemake.output.reliability).with_suffix(".parquet"),
        label_errors=list_of_paths(snakemake.output.label_errors),
        reliability_figure=Path(snakemake.output.reliability_figure),
        origin=snakemake.params.origin,
    )
