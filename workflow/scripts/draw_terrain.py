"""Draw one terrain's meshes and the cuboids of its rocks."""

from pathlib import Path

from polarsim.report.figures.terrain import draw_terrain
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    draw_terrain(
        terrain=int(snakemake.wildcards.terrain),
        rocks=Path(snakemake.input.rocks),
        meshes=Path(snakemake.input.meshes),
        meshes_figure=Path(snakemake.output.meshes_figure),
        crops_figure=Path(snakemake.output.crops_figure),
    )
