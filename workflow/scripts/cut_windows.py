"""Cut windows of labelled cover photos."""

from polarsim.covers.windows import cut_windows
from polarsim.job import job

with job(snakemake) as call:
    call(cut_windows)
