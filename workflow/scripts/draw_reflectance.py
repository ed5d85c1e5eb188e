"""Draw every reflectance model over the phase angle."""

from pathlib import Path

from polarsim.report.figures.brdf import draw_reflectance
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    draw_reflectance(
        curves=Path(snakemake.input.curves),
        figure=Path(snakemake.output.figure),
    )
