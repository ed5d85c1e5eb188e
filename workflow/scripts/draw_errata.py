"""Look for defects in the published labels, and draw them."""

from polarsim.job import job
from polarsim.lint.errata import lint_and_draw

with job(snakemake) as call:
    call(lint_and_draw, workers=snakemake.threads)
