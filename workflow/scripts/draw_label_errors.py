"""Draw the errors of one terrain's labels."""

from pathlib import Path

from polarsim.report.figures.labels import draw_label_errors
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    draw_label_errors(
        terrain=int(snakemake.wildcards.terrain),
        pairs=Path(snakemake.input.pairs),
        figure=Path(snakemake.output.figure),
    )
