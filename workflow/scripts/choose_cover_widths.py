"""Choose the inference widths of the detector of each fold without the photos of the fold."""

from pathlib import Path

from polarsim.cover_photos.widths import choose_widths
from polarsim.detect.options import PredictionOptions
from polarsim.job_files import list_of_paths
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    choose_widths(
        labels=Path(snakemake.input.labels),
        found=dict(zip(snakemake.params.folds, list_of_paths(snakemake.input.found), strict=True)),
        datasets=dict(zip(snakemake.params.folds, list_of_paths(snakemake.input.datasets), strict=True)),
        predictions=Path(snakemake.output.predictions),
        sizes=Path(snakemake.output.sizes),
        site=Site(**snakemake.params.site),
        imgsz=snakemake.params.imgsz,
        options=PredictionOptions(**snakemake.params.options),
        cameras=list_of_paths(snakemake.input.cameras),
        meshes=list_of_paths(snakemake.input.meshes),
    )
