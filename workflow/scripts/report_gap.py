"""Tabulate and draw the ablation."""

from pathlib import Path

from polarsim.report.figures.gap import draw_gap
from polarsim.report.gap_table import tabulate_gap
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    tabulate_gap(
        ablation=Path(snakemake.input.ablation),
        stem=Path(snakemake.output.gap).with_suffix(""),
        origin=snakemake.params.origin,
    )
    draw_gap(
        ablation=Path(snakemake.input.ablation),
        figure=Path(snakemake.output.figure),
        origin=snakemake.params.origin,
    )
