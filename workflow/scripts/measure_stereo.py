"""Depth from pairs of one terrain's photos and twins."""

from pathlib import Path

from polarsim.detect.stereo.measure import measure_stereo
from polarsim.grid import selected_grid
from polarsim.job import job

with job(snakemake) as call:
    # Twins are looked for below the folder of their model, as everywhere in this stage.
    twins = [Path(folder).parent for folder in snakemake.input.twins]
    call(
        measure_stereo,
        keys=call(selected_grid),
        pictures={
            snakemake.params.domain: snakemake.input.photos,
            **dict(zip(snakemake.params.models, twins, strict=True)),
        },
    )
