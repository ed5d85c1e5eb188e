"""Score masks of cover photos against annotated polygons."""

from pathlib import Path

from polarsim.job_files import list_of_paths
from polarsim.reporting import reporting
from polarsim.scoring.masks import score_masks
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    score_masks(
        masks=list_of_paths(snakemake.input.masks),
        root=Path(snakemake.params.root),
        scores=Path(snakemake.output.scores),
        size=Site(**snakemake.params.site).images.size,
        resamples=snakemake.params.resamples,
    )
