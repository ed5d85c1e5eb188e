"""Depth from pairs of one terrain's photos and twins."""

from pathlib import Path

from polarsim.detect.options import PicturesOptions, StereoOptions
from polarsim.detect.stereo.measure import measure_stereo
from polarsim.grid import GridOptions, selected_grid
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    terrain = int(snakemake.wildcards.terrain)
    # Twins are looked for below the folder of their model, as everywhere in this stage.
    twins = [Path(folder).parent for folder in snakemake.input.twins]
    measure_stereo(
        terrain=terrain,
        keys=selected_grid(terrain, snakemake.params.positions, GridOptions(**snakemake.params.grid)),
        cameras=Path(snakemake.input.cameras),
        meshes=Path(snakemake.input.meshes),
        pictures={
            snakemake.params.domain: Path(snakemake.input.photos),
            **dict(zip(snakemake.params.models, twins, strict=True)),
        },
        pairs=Path(snakemake.output.pairs),
        rocks=Path(snakemake.output.rocks),
        options=StereoOptions(**snakemake.params.options),
        curve=PicturesOptions(**snakemake.params.pictures),
        threads=snakemake.threads,
    )
