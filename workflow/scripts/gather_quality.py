"""Gather the quality of every stage."""

from pathlib import Path

from polarsim.report.quality_table import gather_quality
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    gather_quality(
        parts=[Path(path) for path in snakemake.input.parts],
        stem=Path(snakemake.output.table).with_suffix(""),
        origin=snakemake.params.origin,
    )
