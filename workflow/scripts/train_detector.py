"""Train a detector on a domain or mix."""

from pathlib import Path

from polarsim.detect.options import PredictionOptions, TrainingOptions
from polarsim.detect.train import train_detector
from polarsim.job_files import optional_path
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    train_detector(
        dataset=Path(snakemake.input.dataset),
        weights=Path(snakemake.output.weights),
        curve=Path(snakemake.output.curve),
        options=TrainingOptions(**snakemake.params.options),
        prediction=PredictionOptions(**snakemake.params.prediction),
        imgsz=snakemake.params.imgsz,
        seed=int(snakemake.wildcards.seed),
        threads=snakemake.threads,
        work=Path(snakemake.params.work),
        start=optional_path(snakemake.input.start),
    )
