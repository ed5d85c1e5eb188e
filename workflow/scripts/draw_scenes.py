"""Draw some of the strewn scenes that detectors are trained on."""

from polarsim.job import job
from polarsim.report.figures.scenes import draw_scenes

with job(snakemake) as call:
    call(draw_scenes, scenes=dict(zip(snakemake.params.terrains, snakemake.input.scenes, strict=True)))
