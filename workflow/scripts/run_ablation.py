"""Compute the effect of each component of the twin for a split and seed."""

from pathlib import Path

from polarsim.detect.ablation import write_ablation
from polarsim.detect.options import ComparisonOptions, TrainingOptions
from polarsim.job_files import list_of_paths
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    write_ablation(
        predictions=dict(zip(snakemake.params.evaluated, list_of_paths(snakemake.input.predictions), strict=True)),
        labels=dict(zip(snakemake.params.domains, list_of_paths(snakemake.input.labels), strict=True)),
        datasets=dict(zip(snakemake.params.domains, list_of_paths(snakemake.input.datasets), strict=True)),
        photo=snakemake.params.photo,
        twin=snakemake.params.twin,
        replaced=snakemake.params.replaced,
        ablation=Path(snakemake.output.ablation),
        size=Site(**snakemake.params.site).images.size,
        options=ComparisonOptions(**snakemake.params.options),
        training=TrainingOptions(**snakemake.params.training),
        imgsz=snakemake.params.imgsz,
    )
