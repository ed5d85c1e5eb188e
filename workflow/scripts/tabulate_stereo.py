"""Tabulate stereo depth."""

from pathlib import Path

from polarsim.report.stereo_table import tabulate_stereo
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    tabulate_stereo(
        stereo=Path(snakemake.input.stereo),
        instances=Path(snakemake.input.instances),
        ipd=Path(snakemake.input.ipd),
        stem=Path(snakemake.output.stereo).with_suffix(""),
        origin=snakemake.params.origin,
    )
