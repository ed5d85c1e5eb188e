"""Rank the detectors of autonomous drives by gap and by drive metrics."""

from pathlib import Path

from polarsim.job_files import optional_path
from polarsim.reporting import reporting
from polarsim.rover.planning.rank import rank_detectors

with reporting(log=snakemake.log[0]):
    rank_detectors(
        each=Path(snakemake.input.each),
        by_detector=Path(snakemake.output.by_detector),
        ranks=Path(snakemake.output.ranks),
        detection=optional_path(snakemake.input.detection),
        ipd=optional_path(snakemake.input.ipd),
        pair=tuple(snakemake.params.pair),
        split=snakemake.params.split,
    )
