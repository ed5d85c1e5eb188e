"""Tabulate the labels of all terrains and their confidence."""

from pathlib import Path

from polarsim.job_files import paths
from polarsim.report.labels_table import tabulate_labels
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    tabulate_labels(
        pairs=paths(snakemake.input.pairs),
        table=Path(snakemake.output.table).with_suffix(""),
        reliability=Path(snakemake.output.reliability).with_suffix(""),
        seeds=snakemake.params.seeds,
        origin=snakemake.params.origin,
    )
