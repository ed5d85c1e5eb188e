"""Draw one terrain's meshes and the cuboids of its rocks."""

from polarsim.job import job
from polarsim.report.figures.terrain import draw_terrain

with job(snakemake) as call:
    call(draw_terrain)
