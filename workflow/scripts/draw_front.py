"""Draw what the front camera sees, with rocks and what a detector takes for rocks."""

from pathlib import Path

from polarsim.job import job
from polarsim.report.figures.shots import draw_front

with job(snakemake) as call:
    call(draw_front, view=Path(snakemake.input.poses).parent)
