"""Draw what the detectors of a run found."""

from polarsim.job import job
from polarsim.report.figures.detectors import draw_detectors

with job(snakemake) as call:
    call(
        draw_detectors,
        found=dict(snakemake.input.items()),
        figures=dict(snakemake.output.items()),
    )
