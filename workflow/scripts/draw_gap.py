"""Draw the ablation."""

from pathlib import Path

from polarsim.report.figures.gap import draw_gap
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    draw_gap(
        ablation=Path(snakemake.input.ablation),
        figure=Path(snakemake.output.figure),
        origin=snakemake.params.origin,
    )
