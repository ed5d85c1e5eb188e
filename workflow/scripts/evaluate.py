"""Compare all detectors of a split and seed on all domains."""

from pathlib import Path

from polarsim.detect.evaluate import Evaluation, evaluate
from polarsim.detect.options import ComparisonOptions, TrainingOptions
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    evaluate(
        predictions=[Path(path) for path in snakemake.input.predictions],
        labels=dict(zip(snakemake.params.domains, map(Path, snakemake.input.labels), strict=True)),
        datasets=dict(zip(snakemake.params.trained, map(Path, snakemake.input.datasets), strict=True)),
        split=Path(snakemake.input.split),
        by=snakemake.wildcards.split,
        tables_of=Evaluation(**{name: Path(path) for name, path in snakemake.output.items()}),
        options=ComparisonOptions(**snakemake.params.options),
        training=TrainingOptions(**snakemake.params.training),
        imgsz=snakemake.params.imgsz,
    )
