"""Draw the soil's checks."""

from pathlib import Path

from polarsim.report.figures.rover import draw_soil
from polarsim.reporting import reporting
from polarsim.scoring.options import TablesOptions

with reporting(log=snakemake.log[0]):
    draw_soil(
        limit=Path(snakemake.input.limit),
        measured=Path(snakemake.input.measured),
        figure=Path(snakemake.output.figure),
        options=TablesOptions(**snakemake.params.options),
    )
