"""Merge the label tables of all terrains."""

from polarsim.formats.tables import merge_label_tables
from polarsim.job import job

with job(snakemake) as call:
    call(merge_label_tables)
