"""Split the photos of a run into training, validation and test."""

from pathlib import Path

from polarsim.detect.options import SplitOptions
from polarsim.detect.split import split_photos
from polarsim.grid import GridOptions, selected_grids
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    split_photos(
        keys=selected_grids(
            site=Site(**snakemake.params.site),
            terrains=snakemake.params.terrains,
            positions=snakemake.params.positions,
            grid=GridOptions(**snakemake.params.grid),
        ),
        by=snakemake.wildcards.split,
        split=Path(snakemake.output.split),
        options=SplitOptions(**snakemake.params.options),
    )
