"""Draw one drive of each mode of a rover that decides."""

from pathlib import Path

from polarsim.job import job
from polarsim.report.figures.autonomy_maps import draw_autonomy_maps

with job(snakemake) as call:
    call(draw_autonomy_maps, folders=[Path(path).parent for path in snakemake.input.drives])
