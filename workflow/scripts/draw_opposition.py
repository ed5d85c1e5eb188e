"""Draw photo and twins near and far from opposition."""

from pathlib import Path

from polarsim.grid import GridOptions, selected_grids
from polarsim.job_files import list_of_paths
from polarsim.report.figures.opposition import draw_opposition
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    draw_opposition(
        site=Site(**snakemake.params.site),
        keys=selected_grids(
            site=Site(**snakemake.params.site),
            terrains=snakemake.params.terrains,
            positions=snakemake.params.positions,
            grid=GridOptions(**snakemake.params.grid),
        ),
        cameras=dict(zip(snakemake.params.terrains, list_of_paths(snakemake.input.cameras), strict=True)),
        photo_domain=snakemake.params.photo_domain,
        models=snakemake.params.models,
        pictures=list_of_paths(snakemake.input.pictures),
        figure=Path(snakemake.output.figure),
        text=Path(snakemake.output.text),
    )
