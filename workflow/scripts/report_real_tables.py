"""Tabulate and draw detectors of cover photos and of their twins."""

from pathlib import Path

from polarsim.job_files import list_of_paths
from polarsim.report.figures.detectors import draw_ipd
from polarsim.report.figures.real_pairs import draw_real_pairs
from polarsim.report.real_tables import tabulate_real_tables
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    tabulate_real_tables(
        detection=Path(snakemake.input.detection),
        ipd=Path(snakemake.input.ipd),
        differences=Path(snakemake.input.differences),
        photos=Path(snakemake.input.photos),
        pictures=Path(snakemake.input.pictures[0]),
        drawn=Path(snakemake.input.drawn),
        twins={domain: Path(folder) for domain, folder in snakemake.params.twins.items()},
        tables=Path(snakemake.output.real_detection).parent,
        origin=snakemake.params.origin,
    )
    draw_ipd(
        ipd=Path(snakemake.input.ipd),
        figure=Path(snakemake.output.ipd_figure),
        origin=snakemake.params.origin,
    )
    draw_real_pairs(
        pictures=dict(zip(snakemake.params.domains, list_of_paths(snakemake.input.pictures), strict=True)),
        labels=dict(zip(snakemake.params.domains, list_of_paths(snakemake.input.labels), strict=True)),
        figure=Path(snakemake.output.pairs_figure),
    )
