"""Link windows and images of a domain to the data set of a fold."""

from pathlib import Path

from polarsim.cover_photos.datasets import make_twin_dataset
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    make_twin_dataset(
        domain=snakemake.wildcards.cover_domain,
        pictures=Path(snakemake.input.pictures),
        windows=Path(snakemake.input.windows),
        test=snakemake.params.test,
        dataset=Path(snakemake.output.dataset),
        seed=snakemake.params.seed,
    )
