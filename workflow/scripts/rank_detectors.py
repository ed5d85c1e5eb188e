"""Rank the detectors of autonomous drives by gap and by drive metrics, and write the table."""

from pathlib import Path

from polarsim.job_files import optional_path
from polarsim.report.autonomy_table import tabulate_rank
from polarsim.reporting import reporting
from polarsim.rover.planning.rank import rank_detectors

by_detector, ranks = Path(snakemake.output.by_detector), Path(snakemake.output.ranks)
with reporting(log=snakemake.log[0]):
    rank_detectors(
        each=Path(snakemake.input.each),
        by_detector=by_detector,
        ranks=ranks,
        detection=optional_path(snakemake.input.detection),
        ipd=optional_path(snakemake.input.ipd),
        pair=tuple(snakemake.params.pair),
        split=snakemake.params.split,
    )
    tabulate_rank(
        by_detector=by_detector,
        ranks=ranks,
        stem=Path(snakemake.output.table).with_suffix(""),
        origin=snakemake.params.origin,
    )
