"""Draw the detections of each detector in photos and twins."""

from pathlib import Path

from polarsim.job_files import list_of_paths
from polarsim.report.figures.detections import draw_detector_results
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    draw_detector_results(
        site=Site(**snakemake.params.site),
        domains=snakemake.params.domains,
        photo_domain=snakemake.params.photo_domain,
        pictures=list_of_paths(snakemake.input.pictures),
        instances=Path(snakemake.input.instances),
        ipd=Path(snakemake.input.ipd),
        predictions=list_of_paths(snakemake.input.predictions),
        labels=dict(zip(snakemake.params.domains, list_of_paths(snakemake.input.labels), strict=True)),
        seen=list_of_paths(snakemake.output.seen),
        gap_rocks=list_of_paths(snakemake.output.gap_rocks),
        origin=snakemake.params.origin,
    )
