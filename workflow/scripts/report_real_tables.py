"""Tabulate detectors of cover photos and of their twins."""

from pathlib import Path

from polarsim.report.real_tables import tabulate_real_tables
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    tabulate_real_tables(
        detection=Path(snakemake.input.detection),
        ipd=Path(snakemake.input.ipd),
        differences=Path(snakemake.input.differences),
        photos=Path(snakemake.input.photos),
        tables=Path(snakemake.output.real_detection).parent,
        origin=snakemake.params.origin,
    )
