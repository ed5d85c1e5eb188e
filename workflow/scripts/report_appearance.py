"""Tabulate the appearance of twins next to their photos; draw photos, twins and differences."""

from pathlib import Path

from polarsim.job_files import list_of_paths, optional_path
from polarsim.report.appearance_table import tabulate_appearance
from polarsim.report.figures.appearance import draw_appearance
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    tabulate_appearance(
        pairs=list_of_paths(snakemake.input.appearance),
        table=Path(snakemake.output.appearance).with_suffix(""),
        differences=Path(snakemake.output.appearance_differences).with_suffix(""),
        origin=snakemake.params.origin,
    )
    draw_appearance(
        pairs=list_of_paths(snakemake.input.appearance),
        photos=list_of_paths(snakemake.input.photos),
        twins=list_of_paths(snakemake.input.twins),
        drawn=optional_path(snakemake.input.drawn),
        figure=Path(snakemake.output.figure),
    )
