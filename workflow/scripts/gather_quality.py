"""Gather the quality of every stage."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.tables.quality import gather_quality

with reporting(log=snakemake.log[0]):
    gather_quality(
        parts=[Path(path) for path in snakemake.input.parts],
        stem=Path(snakemake.output.table).with_suffix(""),
        origin=snakemake.params.origin,
    )
