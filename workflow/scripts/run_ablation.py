"""Measure every component of the twin by what the detectors of a split and seed see."""

from polarsim.detect.ablation import write_ablation
from polarsim.job import job

with job(snakemake) as call:
    call(
        write_ablation,
        predictions=dict(zip(map(tuple, snakemake.params.evaluated), snakemake.input.predictions, strict=True)),
        labels=dict(zip(snakemake.params.domains, snakemake.input.labels, strict=True)),
        datasets=dict(zip(snakemake.params.domains, snakemake.input.datasets, strict=True)),
    )
