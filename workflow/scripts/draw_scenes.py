"""Draw some of the strewn scenes that detectors are trained on."""

from pathlib import Path

from polarsim.report.figures.scenes import draw_scenes
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    draw_scenes(
        scenes=dict(zip(snakemake.params.terrains, map(Path, snakemake.input.scenes), strict=True)),
        figure=Path(snakemake.output.figure),
    )
