"""Draw the modes of a rover that decides side by side, and its ways."""

from pathlib import Path

from polarsim.job import job
from polarsim.report.figures.autonomy import draw_autonomy

with job(snakemake) as call:
    call(draw_autonomy, folders=[Path(path).parent for path in snakemake.input.drives])
