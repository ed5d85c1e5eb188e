"""Cut windows from front camera images of drives for fine-tuning."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.rover.perception.fine_tuning import make_drive_dataset
from polarsim.rover.perception.options import DriveTuningOptions

with reporting(log=snakemake.log[0]):
    make_drive_dataset(
        dataset=Path(snakemake.output.dataset),
        options=DriveTuningOptions(**snakemake.params.options),
    )
