"""Link windows of cover photos and scenes to the fine-tuning data set of a fold."""

from pathlib import Path

from polarsim.cover_photos.datasets import make_fine_tuning_dataset
from polarsim.job_files import list_of_paths
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    make_fine_tuning_dataset(
        scenes=dict(zip(snakemake.params.train, list_of_paths(snakemake.input.scenes), strict=True)),
        windows=Path(snakemake.input.windows),
        test=snakemake.params.test,
        dataset=Path(snakemake.output.dataset),
        seed=snakemake.params.seed,
    )
