"""Carry one terrain's seed labels to every photo."""

from pathlib import Path

from polarsim.grid import GridOptions, selected_grid
from polarsim.labels.options import LabelsOptions
from polarsim.labels.propagate import propagate_labels
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    terrain = int(snakemake.wildcards.terrain)
    propagate_labels(
        terrain=terrain,
        keys=selected_grid(terrain, snakemake.params.positions, GridOptions(**snakemake.params.grid)),
        photos=Path(snakemake.input.photos),
        inventory=Path(snakemake.input.inventory),
        seeds=Path(snakemake.input.seeds),
        cameras=Path(snakemake.input.cameras),
        meshes=Path(snakemake.input.meshes),
        boxes=Path(snakemake.output.boxes),
        table=Path(snakemake.output.table),
        options=LabelsOptions(**snakemake.params.options),
    )
