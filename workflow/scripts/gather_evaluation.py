"""Gather the evaluation of every stage."""

from pathlib import Path

from polarsim.job_files import paths
from polarsim.report.evaluation_table import gather_evaluation
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    gather_evaluation(
        parts=paths(snakemake.input.parts),
        stem=Path(snakemake.output.table).with_suffix(""),
        origin=snakemake.params.origin,
    )
