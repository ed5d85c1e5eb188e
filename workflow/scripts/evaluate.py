"""Compare all detectors of a split and seed on all domains."""

from polarsim.detect.evaluate import Evaluation, evaluate
from polarsim.job import job

with job(snakemake) as call:
    call(
        evaluate,
        labels=dict(zip(snakemake.params.domains, snakemake.input.labels, strict=True)),
        datasets=dict(zip(snakemake.params.trained, snakemake.input.datasets, strict=True)),
        by=snakemake.wildcards.split,
        tables_of=call(Evaluation),
    )
