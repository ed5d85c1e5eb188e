"""Hold one terrain's scans, cameras, meshes and boxes against each other."""

from pathlib import Path

from polarsim.job_files import optional_path
from polarsim.reporting import reporting
from polarsim.scoring.consistency import check_consistency

with reporting(log=snakemake.log[0]):
    check_consistency(
        terrain=int(snakemake.wildcards.terrain),
        inventory=Path(snakemake.input.inventory),
        located=Path(snakemake.input.located),
        cameras=Path(snakemake.input.cameras),
        meshes=Path(snakemake.input.meshes),
        photos=optional_path(snakemake.input.photos),
        annotated=optional_path(snakemake.params.annotated),
        evaluation=Path(snakemake.output.evaluation),
    )
