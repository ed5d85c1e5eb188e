"""Tabulate the evaluation of every stage, and of twins in detail."""

from pathlib import Path

from polarsim.job_files import list_of_paths
from polarsim.report.evaluation_table import gather_evaluation
from polarsim.report.render_table import tabulate_render
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    gather_evaluation(
        site=Site(**snakemake.params.site),
        parts=list_of_paths(snakemake.input.parts),
        stem=Path(snakemake.output.evaluation).with_suffix(""),
        origin=snakemake.params.origin,
    )
    tabulate_render(
        pairs=list_of_paths(snakemake.input.appearance),
        evaluation=list_of_paths(snakemake.input.twins),
        table=Path(snakemake.output.render).with_suffix(""),
        origin=snakemake.params.origin,
    )
