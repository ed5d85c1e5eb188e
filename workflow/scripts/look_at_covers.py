"""Look at the cover photos of a fold's terrains with its detector, at several widths."""

from polarsim.covers.widths import look_at_covers
from polarsim.job import job

with job(snakemake) as call:
    call(look_at_covers)
