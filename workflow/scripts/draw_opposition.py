"""Draw photo and twins near opposition and far from it."""

from pathlib import Path

from polarsim.grid import GridOptions, selected_grids
from polarsim.report.figures.opposition import draw_opposition
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    draw_opposition(
        keys=selected_grids(
            snakemake.params.terrains, snakemake.params.positions, GridOptions(**snakemake.params.grid)
        ),
        cameras=dict(zip(snakemake.params.terrains, map(Path, snakemake.input.cameras), strict=True)),
        photo_domain=snakemake.params.photo_domain,
        models=snakemake.params.models,
        pictures=map(Path, snakemake.input.pictures),
        figure=Path(snakemake.output.figure),
        text=Path(snakemake.output.text),
    )
