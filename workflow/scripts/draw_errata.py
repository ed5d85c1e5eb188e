"""Find defects in the published labels and draw them."""

from pathlib import Path

from polarsim.job_files import list_of_paths
from polarsim.lint.errata import lint_and_draw
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    lint_and_draw(
        site=Site(**snakemake.params.site),
        root=Path(snakemake.params.root),
        twins=list_of_paths(snakemake.input.twins),
        page=Path(snakemake.output.page),
        table=Path(snakemake.output.table),
        workers=snakemake.threads,
    )
