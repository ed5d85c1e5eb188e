"""Draw photo and twins near opposition and far from it."""

from polarsim.grid import selected_grids
from polarsim.job import job
from polarsim.report.figures.opposition import draw_opposition

with job(snakemake) as call:
    call(
        draw_opposition,
        keys=call(selected_grids),
        cameras=dict(zip(snakemake.params.terrains, snakemake.input.cameras, strict=True)),
    )
