"""Score one terrain's rocks and meshes."""

from pathlib import Path

from polarsim.job_files import optional_path
from polarsim.reporting import reporting
from polarsim.scoring.rocks import score_rocks

with reporting(log=snakemake.log[0]):
    score_rocks(
        terrain=int(snakemake.wildcards.terrain),
        rocks=Path(snakemake.input.rocks),
        meshes=Path(snakemake.input.meshes),
        located=Path(snakemake.input.located),
        cameras=Path(snakemake.input.cameras),
        truth=optional_path(snakemake.params.truth),
        inventory=Path(snakemake.input.inventory),
        evaluation=Path(snakemake.output.evaluation),
        scores=Path(snakemake.output.scores),
        offsets=Path(snakemake.output.offsets),
    )
