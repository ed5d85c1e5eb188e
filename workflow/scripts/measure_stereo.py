"""Compute stereo depth of the photos and twins of a terrain."""

from pathlib import Path

from polarsim.detect.options import StereoOptions
from polarsim.detect.stereo.measure import measure_stereo
from polarsim.grid import GridOptions, selected_grid
from polarsim.job_files import list_of_paths
from polarsim.photo import parse_terrain
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    measure_stereo(
        site=Site(**snakemake.params.site),
        terrain=parse_terrain(snakemake.wildcards.terrain),
        keys=selected_grid(
            site=Site(**snakemake.params.site),
            terrain=parse_terrain(snakemake.wildcards.terrain),
            positions=snakemake.params.positions,
            grid=GridOptions(**snakemake.params.grid),
        ),
        cameras=Path(snakemake.input.cameras),
        meshes=Path(snakemake.input.meshes),
        pictures={
            snakemake.params.domain: Path(snakemake.input.photos),
            # The function finds the twins of a terrain below the folder of their model.
            **dict(
                zip(
                    snakemake.params.models, [path.parent for path in list_of_paths(snakemake.input.twins)], strict=True
                )
            ),
        },
        pairs=Path(snakemake.output.pairs),
        rocks=Path(snakemake.output.rocks),
        options=StereoOptions(**snakemake.params.options),
        threads=snakemake.threads,
    )
