"""Tabulate what the detectors of a run found."""

from pathlib import Path

from polarsim.report.detectors import tabulate_detectors
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    tabulate_detectors(
        found={name: Path(path) for name, path in snakemake.input.items()},
        tables=Path(snakemake.output.detection).parent,
        origin=snakemake.params.origin,
        min_mean_dn=snakemake.params.min_mean_dn,
    )
