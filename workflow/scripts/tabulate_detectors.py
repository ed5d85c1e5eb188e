"""Tabulate what the detectors of a run found."""

from pathlib import Path

from polarsim.job import job
from polarsim.report.detectors import tabulate_detectors

with job(snakemake) as call:
    call(
        tabulate_detectors,
        found=dict(snakemake.input.items()),
        tables=Path(snakemake.output.detection).parent,
    )
