"""Draw the confidence of labels against the share of them that are right."""

from pathlib import Path

from polarsim.report.figures.reliability import draw_reliability
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    draw_reliability(
        reliability=Path(snakemake.input.reliability),
        figure=Path(snakemake.output.figure),
        origin=snakemake.params.origin,
    )
