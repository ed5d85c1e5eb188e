"""Draw how far one terrain's projected meshes lie from the boxes that people drew."""

from pathlib import Path

from polarsim.job_files import optional_path
from polarsim.report.figures.residuals import draw_residuals
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    draw_residuals(
        terrain=int(snakemake.wildcards.terrain),
        cameras=Path(snakemake.input.cameras),
        meshes=Path(snakemake.input.meshes),
        seeds=Path(snakemake.input.seeds),
        photos=Path(snakemake.input.photos),
        inventory=Path(snakemake.input.inventory),
        twins=optional_path(snakemake.input.twins),
        figure=Path(snakemake.output.figure),
    )
