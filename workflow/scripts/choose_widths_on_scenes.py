"""Choose the widths at which a detector finds most in scenes that it has not seen."""

from pathlib import Path

from polarsim.cover_photos.widths import choose_on_scenes
from polarsim.detect.options import PredictionOptions
from polarsim.job_files import paths
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    choose_on_scenes(
        weights=Path(snakemake.input.weights),
        scenes=paths(snakemake.input.scenes),
        sized=Path(snakemake.output.sized),
        widths=snakemake.params.widths,
        options=PredictionOptions(**snakemake.params.options),
        threads=snakemake.threads,
    )
