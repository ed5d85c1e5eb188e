"""Draw what the detectors of a run found."""

from pathlib import Path

from polarsim.report.figures.detectors import draw_detectors
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    draw_detectors(
        detection=Path(snakemake.input.detection),
        curves=Path(snakemake.input.curves),
        ipd=Path(snakemake.input.ipd),
        rocks=Path(snakemake.input.rocks),
        detection_figure=Path(snakemake.output.detection_figure),
        curves_figure=Path(snakemake.output.curves_figure),
        ipd_figure=Path(snakemake.output.ipd_figure),
        rocks_figure=Path(snakemake.output.rocks_figure),
        origin=snakemake.params.origin,
    )
