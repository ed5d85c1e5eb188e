"""Draw randomised training scenes."""

from pathlib import Path

from polarsim.job_files import list_of_paths
from polarsim.report.figures.scenes import draw_scenes
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    draw_scenes(
        scenes=dict(zip(snakemake.params.terrains, list_of_paths(snakemake.input.scenes), strict=True)),
        figure=Path(snakemake.output.figure),
    )
