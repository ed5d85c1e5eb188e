"""Merge stereo depth of all terrains and compute the IPD."""

from pathlib import Path

from polarsim.detect.options import ComparisonOptions
from polarsim.detect.stereo.measure import compare_stereo
from polarsim.job_files import list_of_paths
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    compare_stereo(
        pairs=list_of_paths(snakemake.input.pairs),
        rocks=list_of_paths(snakemake.input.rocks),
        stereo=Path(snakemake.output.stereo),
        instances=Path(snakemake.output.instances),
        ipd=Path(snakemake.output.ipd),
        options=ComparisonOptions(**snakemake.params.options),
    )
