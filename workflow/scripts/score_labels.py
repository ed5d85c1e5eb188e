"""Score the labels of a terrain."""

from pathlib import Path

from polarsim.grid import GridOptions, selected_grid
from polarsim.photo import parse_terrain
from polarsim.reporting import reporting
from polarsim.scoring.labels import score_labels
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    score_labels(
        site=Site(**snakemake.params.site),
        terrain=parse_terrain(snakemake.wildcards.terrain),
        keys=selected_grid(
            site=Site(**snakemake.params.site),
            terrain=parse_terrain(snakemake.wildcards.terrain),
            positions=snakemake.params.positions,
            grid=GridOptions(**snakemake.params.grid),
        ),
        table=Path(snakemake.input.table),
        truth=Path(snakemake.params.truth),
        seeds=Path(snakemake.input.seeds),
        evaluation=Path(snakemake.output.evaluation),
        pairs=Path(snakemake.output.pairs),
    )
