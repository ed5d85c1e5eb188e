"""Score the outlines of a terrain against annotated polygons."""

from pathlib import Path

from polarsim.grid import GridOptions, selected_grid
from polarsim.photo import parse_terrain
from polarsim.reporting import reporting
from polarsim.scoring.outlines import score_outlines
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    score_outlines(
        site=Site(**snakemake.params.site),
        terrain=parse_terrain(snakemake.wildcards.terrain),
        keys=selected_grid(
            site=Site(**snakemake.params.site),
            terrain=parse_terrain(snakemake.wildcards.terrain),
            positions=snakemake.params.positions,
            grid=GridOptions(**snakemake.params.grid),
        ),
        annotations=Path(snakemake.input.annotations),
        root=Path(snakemake.params.root),
        evaluation=Path(snakemake.output.evaluation),
    )
