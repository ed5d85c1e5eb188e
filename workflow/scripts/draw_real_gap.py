"""Draw the difference of detection between photos and twins over the appearance of the twins."""

from pathlib import Path

from polarsim.report.figures.real_gap import draw_real_gap
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    draw_real_gap(
        photos=Path(snakemake.input.photos),
        figure=Path(snakemake.output.figure),
    )
