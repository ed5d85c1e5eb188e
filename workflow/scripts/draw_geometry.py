"""Draw the meshes and cameras of a terrain."""

from pathlib import Path

from polarsim.job_files import optional_path
from polarsim.photo import parse_terrain
from polarsim.report.figures.offsets import draw_offsets
from polarsim.report.figures.residuals import draw_residuals
from polarsim.report.figures.terrain import draw_terrain
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    draw_terrain(
        site=Site(**snakemake.params.site),
        terrain=parse_terrain(snakemake.wildcards.terrain),
        rocks=Path(snakemake.input.rocks),
        meshes=Path(snakemake.input.meshes),
        meshes_figure=Path(snakemake.output.meshes_figure),
        crops_figure=Path(snakemake.output.crops_figure),
    )
    draw_residuals(
        site=Site(**snakemake.params.site),
        terrain=parse_terrain(snakemake.wildcards.terrain),
        cameras=Path(snakemake.input.cameras),
        meshes=Path(snakemake.input.meshes),
        seeds=Path(snakemake.input.seeds),
        photos=Path(snakemake.input.photos),
        inventory=Path(snakemake.input.inventory),
        twins=optional_path(snakemake.input.twins),
        figure=Path(snakemake.output.residuals_figure),
    )
    draw_offsets(
        site=Site(**snakemake.params.site),
        terrain=parse_terrain(snakemake.wildcards.terrain),
        offsets=optional_path(snakemake.input.offsets),
        figure=optional_path(snakemake.output.offsets_figure),
    )
