"""Merge the photo tables of all terrains."""

from pathlib import Path

from polarsim.acquire.index import merge_photos
from polarsim.job_files import list_of_paths
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    merge_photos(
        tables=list_of_paths(snakemake.input.tables),
        merged=Path(snakemake.output.merged),
    )
