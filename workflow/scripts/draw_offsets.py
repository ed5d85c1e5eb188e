"""Draw how far one terrain's meshes lie from the true surface."""

from pathlib import Path

from polarsim.report.figures.offsets import draw_offsets
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    draw_offsets(
        terrain=int(snakemake.wildcards.terrain),
        offsets=Path(snakemake.input.offsets),
        figure=Path(snakemake.output.figure),
    )
