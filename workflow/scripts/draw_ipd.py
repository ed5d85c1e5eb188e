"""Draw the figures of every pair of domains."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.tables.figures.judges import draw_ipd
from polarsim.tables.options import TablesOptions

with reporting(log=snakemake.log[0]):
    draw_ipd(
        ipd=Path(snakemake.input.ipd),
        figure=Path(snakemake.output.figure),
        origin=snakemake.params.origin,
        options=TablesOptions(**snakemake.params.options),
    )
