"""Draw one terrain's meshes."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.tables.figures.terrain import draw_meshes
from polarsim.tables.options import TablesOptions

with reporting(log=snakemake.log[0]):
    draw_meshes(
        terrain=int(snakemake.wildcards.terrain),
        meshes=Path(snakemake.input.meshes),
        figure=Path(snakemake.output.figure),
        options=TablesOptions(**snakemake.params.options),
    )
