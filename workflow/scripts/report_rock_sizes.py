"""Tabulate and draw the sizes of rocks."""

from pathlib import Path

from polarsim.job_files import list_of_paths
from polarsim.report.rock_sizes import report_rock_sizes
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    report_rock_sizes(
        sizes=dict(zip(snakemake.params.terrains, list_of_paths(snakemake.input.sizes), strict=True)),
        areas=dict(zip(snakemake.params.terrains, list_of_paths(snakemake.input.areas), strict=True)),
        true_sizes=dict(zip(snakemake.params.terrains, list_of_paths(snakemake.input.true_sizes), strict=False)),
        table=Path(snakemake.output.rock_sizes).with_suffix(""),
        abundance=Path(snakemake.output.rock_abundance).with_suffix(""),
        figure=Path(snakemake.output.figure),
        origin=snakemake.params.origin,
    )
