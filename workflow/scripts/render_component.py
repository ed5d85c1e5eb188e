"""Render the twins of one terrain's test photos with one component replaced."""

from pathlib import Path

from polarsim.detect.split import tested_keys
from polarsim.grid import GridOptions, selected_grid
from polarsim.render.options import RenderOptions
from polarsim.render.twins import LabelPaths, render_twins
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    terrain = int(snakemake.wildcards.terrain)
    render_twins(
        terrain=terrain,
        keys=selected_grid(terrain, snakemake.params.positions, GridOptions(**snakemake.params.grid)),
        only=tested_keys([Path(path) for path in snakemake.input.splits]),
        cameras=Path(snakemake.input.cameras),
        lamps=Path(snakemake.input.lamps),
        meshes=Path(snakemake.input.meshes),
        photos=Path(snakemake.input.photos),
        twins={snakemake.params.model: Path(snakemake.output.twins)},
        labels=LabelPaths(
            boxes=Path(snakemake.output.boxes),
            instances=Path(snakemake.output.instances),
            annotations=Path(snakemake.output.annotations),
            table=Path(snakemake.output.table),
        ),
        options=RenderOptions(**snakemake.params.options),
        threads=snakemake.threads,
        materials=Path(snakemake.input.materials) if snakemake.input.materials else None,
    )
