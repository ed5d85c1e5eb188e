"""Merge the label tables of all terrains."""

from pathlib import Path

from polarsim.formats.tables import merge_label_tables
from polarsim.job_files import list_of_paths
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    merge_label_tables(
        tables=list_of_paths(snakemake.input.tables),
        merged=Path(snakemake.output.merged),
    )
