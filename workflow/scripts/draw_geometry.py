"""Draw the meshes and cameras of a terrain."""

from pathlib import Path

from polarsim.job_files import optional_path
from polarsim.report.figures.geometry import draw_geometry
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    draw_geometry(
        terrain=int(snakemake.wildcards.terrain),
        rocks=Path(snakemake.input.rocks),
        meshes=Path(snakemake.input.meshes),
        cameras=Path(snakemake.input.cameras),
        seeds=Path(snakemake.input.seeds),
        photos=Path(snakemake.input.photos),
        inventory=Path(snakemake.input.inventory),
        twins=optional_path(snakemake.input.twins),
        offsets=optional_path(snakemake.input.offsets),
        meshes_figure=Path(snakemake.output.meshes_figure),
        crops_figure=Path(snakemake.output.crops_figure),
        residuals_figure=Path(snakemake.output.residuals_figure),
        offsets_figure=optional_path(snakemake.output.offsets_figure),
    )
