"""Gather the evaluation of every stage."""

from polarsim.job import job
from polarsim.report.evaluation_table import gather_evaluation

with job(snakemake) as call:
    call(gather_evaluation, stem=snakemake.output.table.removesuffix(".csv"))
