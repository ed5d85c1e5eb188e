"""Propagate the seed labels of a terrain to every photo."""

from pathlib import Path

from polarsim.grid import GridOptions, selected_grid
from polarsim.labels.options import LabelsOptions
from polarsim.labels.propagate import PropagationInputs, propagate_labels
from polarsim.photo import parse_terrain
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    propagate_labels(
        inputs=PropagationInputs(
            site=Site(**snakemake.params.site),
            terrain=parse_terrain(snakemake.wildcards.terrain),
            keys=selected_grid(
                site=Site(**snakemake.params.site),
                terrain=parse_terrain(snakemake.wildcards.terrain),
                positions=snakemake.params.positions,
                grid=GridOptions(**snakemake.params.grid),
            ),
            photos=Path(snakemake.input.photos),
            inventory=Path(snakemake.input.inventory),
            seeds=Path(snakemake.input.seeds),
            cameras=Path(snakemake.input.cameras),
            meshes=Path(snakemake.input.meshes),
        ),
        boxes=Path(snakemake.output.boxes),
        table=Path(snakemake.output.table),
        options=LabelsOptions(**snakemake.params.options),
    )
