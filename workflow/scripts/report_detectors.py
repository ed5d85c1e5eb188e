"""Tabulate and draw the metrics of detectors."""

from pathlib import Path

from polarsim.job_files import optional_path
from polarsim.report.detectors import tabulate_detectors
from polarsim.report.figures.detectors import draw_detectors
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    tabulate_detectors(
        detection=Path(snakemake.input.detection),
        differences=Path(snakemake.input.differences),
        breakdown=Path(snakemake.input.breakdown),
        false_positives=Path(snakemake.input.false_positives),
        ipd=Path(snakemake.input.ipd),
        rocks=Path(snakemake.input.rocks),
        others=optional_path(snakemake.input.others),
        tables=Path(snakemake.output.detection).parent,
        origin=snakemake.params.origin,
    )
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
