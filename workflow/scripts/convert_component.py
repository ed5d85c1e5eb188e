"""Convert the test images of the twins of a component."""

from pathlib import Path

from polarsim.detect.dataset import make_dataset
from polarsim.detect.options import PicturesOptions
from polarsim.detect.split import TEST
from polarsim.job_files import list_of_paths
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    make_dataset(
        domain=snakemake.wildcards.component,
        pictures=list_of_paths(snakemake.input.pictures)[0].parent,
        labels=Path(snakemake.input.labels),
        split=Path(snakemake.input.split),
        dataset=Path(snakemake.output.dataset),
        size=Site(**snakemake.params.site).images.size,
        options=PicturesOptions(**snakemake.params.options),
        by=snakemake.wildcards.split,
        wanted=[TEST],
    )
