"""Draw the modes of a rover that decides side by side, and its ways."""

from pathlib import Path

from polarsim.job_files import paths
from polarsim.report.figures.autonomy import draw_autonomy
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    draw_autonomy(
        folders=[path.parent for path in paths(snakemake.input.drives)],
        together=Path(snakemake.input.together),
        figure=Path(snakemake.output.figure),
        ways=Path(snakemake.output.ways),
        origin=snakemake.params.origin,
    )
