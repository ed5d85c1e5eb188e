"""Fine-tune the detector on board with images of other drives."""

from pathlib import Path

from polarsim.detect.options import PredictionOptions
from polarsim.reporting import reporting
from polarsim.rover.perception.fine_tuning import fine_tune
from polarsim.rover.perception.options import DriveTuningOptions

with reporting(log=snakemake.log[0]):
    fine_tune(
        dataset=Path(snakemake.input.dataset),
        start=Path(snakemake.input.start),
        weights=Path(snakemake.output.weights),
        curve=Path(snakemake.output.curve),
        options=DriveTuningOptions(**snakemake.params.options),
        prediction=PredictionOptions(**snakemake.params.prediction),
        threads=snakemake.threads,
        work=Path(snakemake.params.work),
    )
