"""Draw a photo beside its twins."""

from pathlib import Path

from polarsim.job_files import paths
from polarsim.photo import PhotoKey
from polarsim.report.figures.comparison import draw_comparison
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    draw_comparison(
        key=PhotoKey.parse(snakemake.params.key),
        photos=Path(snakemake.input.photos),
        inventory=Path(snakemake.input.inventory),
        twins=dict(zip(snakemake.params.models, paths(snakemake.input.twins), strict=True)),
        labels=Path(snakemake.input.labels),
        rendered=Path(snakemake.input.rendered),
        figure=Path(snakemake.output.figure),
    )
