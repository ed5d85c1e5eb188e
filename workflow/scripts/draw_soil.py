"""Draw the soil's checks."""

from pathlib import Path

from polarsim.report.figures.soil import draw_soil
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    draw_soil(
        limit=Path(snakemake.input.limit),
        measured=Path(snakemake.input.measured),
        figure=Path(snakemake.output.figure),
    )
