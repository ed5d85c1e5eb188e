"""Compare all detectors of a split and seed on all domains."""

from pathlib import Path

from polarsim.detect.evaluate import evaluate
from polarsim.detect.options import ComparisonOptions, TrainingOptions
from polarsim.job_files import list_of_paths
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    evaluate(
        predictions=list_of_paths(snakemake.input.predictions),
        labels=dict(zip(snakemake.params.domains, list_of_paths(snakemake.input.labels), strict=True)),
        datasets=dict(zip(snakemake.params.trained, list_of_paths(snakemake.input.datasets), strict=True)),
        split=Path(snakemake.input.split),
        by=snakemake.wildcards.split,
        tables_of={name: Path(table) for name, table in snakemake.output.items()},
        size=Site(**snakemake.params.site).images.size,
        options=ComparisonOptions(**snakemake.params.options),
        training=TrainingOptions(**snakemake.params.training),
        imgsz=snakemake.params.imgsz,
    )
