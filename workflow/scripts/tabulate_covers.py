"""Tabulate the scores of detectors on cover photos."""

from pathlib import Path

from polarsim.job_files import list_of_paths
from polarsim.report.covers_table import tabulate_covers
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    tabulate_covers(
        scores=list_of_paths(snakemake.input.scores),
        stem=Path(snakemake.output.table).with_suffix(""),
        origin=snakemake.params.origin,
    )
