"""Draw the cuboids of one terrain's rocks."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.tables.figures.terrain import draw_crops
from polarsim.tables.options import TablesOptions

with reporting(log=snakemake.log[0]):
    draw_crops(
        terrain=int(snakemake.wildcards.terrain),
        rocks=Path(snakemake.input.rocks),
        meshes=Path(snakemake.input.meshes),
        figure=Path(snakemake.output.figure),
        options=TablesOptions(**snakemake.params.options),
    )
