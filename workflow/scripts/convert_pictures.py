"""Convert the images and labels of a domain."""

from pathlib import Path

from polarsim.detect.options import PicturesOptions
from polarsim.detect.pictures import convert_domain
from polarsim.grid import GridOptions, selected_grids
from polarsim.job_files import list_of_paths
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    convert_domain(
        domain=snakemake.wildcards.domain,
        pictures=Path(snakemake.params.pictures),
        labels=list_of_paths(snakemake.input.labels),
        keys=selected_grids(
            site=Site(**snakemake.params.site),
            terrains=snakemake.params.terrains,
            positions=snakemake.params.positions,
            grid=GridOptions(**snakemake.params.grid),
        ),
        size=Site(**snakemake.params.site).images.size,
        folder=Path(snakemake.output.pictures),
        options=PicturesOptions(**snakemake.params.options),
        masks=list_of_paths(snakemake.input.masks),
    )
