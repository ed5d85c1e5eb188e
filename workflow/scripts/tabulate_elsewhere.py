"""Tabulate the evaluation on images from outside POLAR."""

from pathlib import Path

from polarsim.job_files import list_of_paths
from polarsim.report.elsewhere_table import tabulate_elsewhere
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    tabulate_elsewhere(
        scores=list_of_paths(snakemake.input.scores),
        table=Path(snakemake.output.elsewhere).with_suffix(""),
        origin=snakemake.params.origin,
    )
