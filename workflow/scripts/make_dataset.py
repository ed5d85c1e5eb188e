"""Link the images of a domain to the data set of a split."""

from pathlib import Path

from polarsim.detect.dataset import share_pictures
from polarsim.detect.options import SplitOptions
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    share_pictures(
        domain=snakemake.wildcards.domain,
        pictures=Path(snakemake.input.pictures),
        split=Path(snakemake.input.split),
        by=snakemake.wildcards.split,
        dataset=Path(snakemake.output.dataset),
        options=SplitOptions(**snakemake.params.options),
    )
