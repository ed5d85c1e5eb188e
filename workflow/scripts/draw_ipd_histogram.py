"""Draw how the performance of single rocks differs between domains."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.tables.figures.ipd_histogram import draw_ipd_histogram
from polarsim.tables.options import TablesOptions

with reporting(log=snakemake.log[0]):
    draw_ipd_histogram(
        rocks=Path(snakemake.input.rocks),
        figure=Path(snakemake.output.figure),
        origin=snakemake.params.origin,
        options=TablesOptions(**snakemake.params.options),
    )
