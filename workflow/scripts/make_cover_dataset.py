"""Link scenes and cover photos to the data set of a fold."""

from pathlib import Path

from polarsim.cover_photos.datasets import make_cover_dataset
from polarsim.job_files import list_of_paths, optional_path
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    make_cover_dataset(
        scenes=dict(zip(snakemake.params.train, list_of_paths(snakemake.input.scenes), strict=True)),
        covers=optional_path(snakemake.input.covers),
        test=snakemake.params.test,
        dataset=Path(snakemake.output.dataset),
        seed=snakemake.params.seed,
    )
