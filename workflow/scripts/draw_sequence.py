"""Draw moments of the drive."""

from pathlib import Path

from polarsim.job import job
from polarsim.report.figures.shots import draw_sequence

with job(snakemake) as call:
    call(draw_sequence, view=Path(snakemake.input.poses).parent)
