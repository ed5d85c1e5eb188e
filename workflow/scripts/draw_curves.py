"""Draw precision over recall of every judge on every domain."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.tables.figures.curves import draw_curves
from polarsim.tables.options import TablesOptions

with reporting(log=snakemake.log[0]):
    draw_curves(
        curves=Path(snakemake.input.curves),
        figure=Path(snakemake.output.figure),
        origin=snakemake.params.origin,
        options=TablesOptions(**snakemake.params.options),
    )
