"""Score the outlines of a terrain against annotated polygons."""

from pathlib import Path

from polarsim.grid import GridOptions, selected_grid
from polarsim.reporting import reporting
from polarsim.scoring.options import ScoringOptions
from polarsim.scoring.outlines import score_outlines

with reporting(log=snakemake.log[0]):
    score_outlines(
        terrain=int(snakemake.wildcards.terrain),
        keys=selected_grid(
            terrain=int(snakemake.wildcards.terrain),
            positions=snakemake.params.positions,
            grid=GridOptions(**snakemake.params.grid),
        ),
        annotations=Path(snakemake.input.annotations),
        root=Path(snakemake.params.root),
        evaluation=Path(snakemake.output.evaluation),
        options=ScoringOptions(**snakemake.params.options),
    )
