"""Tabulate the scores of masks of cover photos."""

from pathlib import Path

from polarsim.report.covers_table import tabulate_masks
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    tabulate_masks(
        scores=Path(snakemake.input.scores),
        stem=Path(snakemake.output.masks).with_suffix(""),
        origin=snakemake.params.origin,
    )
