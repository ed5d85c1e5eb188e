"""Share scenes and cover photos out to the parts of one fold's data set."""

from pathlib import Path

from polarsim.covers.dataset import make_cover_dataset
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    make_cover_dataset(
        scenes=dict(zip(snakemake.params.train, map(Path, snakemake.input.scenes), strict=True)),
        covers=Path(snakemake.input.covers),
        test=snakemake.params.test,
        dataset=Path(snakemake.output.dataset),
        val_share=snakemake.params.val_share,
        seed=snakemake.params.seed,
    )
