"""Measure every component of the twin by what the detectors of a split and seed see."""

from pathlib import Path

from polarsim.detect.ablation import write_ablation
from polarsim.detect.options import ComparisonOptions, TrainingOptions
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    domains = snakemake.params.domains
    write_ablation(
        predictions=dict(
            zip(map(tuple, snakemake.params.evaluated), map(Path, snakemake.input.predictions), strict=True)
        ),
        labels=dict(zip(domains, map(Path, snakemake.input.labels), strict=True)),
        datasets=dict(zip(domains, map(Path, snakemake.input.datasets), strict=True)),
        photo=snakemake.params.photo,
        twin=snakemake.params.twin,
        replaced=snakemake.params.replaced,
        ablation=Path(snakemake.output.ablation),
        options=ComparisonOptions(**snakemake.params.options),
        training=TrainingOptions(**snakemake.params.training),
        imgsz=snakemake.params.imgsz,
    )
