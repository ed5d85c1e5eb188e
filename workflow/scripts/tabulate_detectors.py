"""Tabulate what the detectors of a run found."""

from pathlib import Path

from polarsim.job_files import optional_path
from polarsim.report.detectors import tabulate_detectors
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
