"""Stereo depth of all terrains, and its IPD."""

from pathlib import Path

from polarsim.detect.options import ComparisonOptions
from polarsim.detect.stereo.compare import compare_stereo
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    compare_stereo(
        pairs=[Path(path) for path in snakemake.input.pairs],
        rocks=[Path(path) for path in snakemake.input.rocks],
        stereo=Path(snakemake.output.stereo),
        instances=Path(snakemake.output.instances),
        ipd=Path(snakemake.output.ipd),
        options=ComparisonOptions(**snakemake.params.options),
    )
