"""Draw the photos, twins and labels of a terrain."""

from pathlib import Path

from polarsim.grid import GridOptions
from polarsim.job_files import list_of_paths
from polarsim.photo import parse_terrain
from polarsim.report.figures.contact import draw_photos
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    draw_photos(
        site=Site(**snakemake.params.site),
        terrain=parse_terrain(snakemake.wildcards.terrain),
        positions=snakemake.params.positions,
        grid=GridOptions(**snakemake.params.grid),
        photos=Path(snakemake.input.photos),
        inventory=Path(snakemake.input.inventory),
        twins=dict(zip(snakemake.params.models, list_of_paths(snakemake.input.twins), strict=True)),
        stand_ins=snakemake.params.stand_ins,
        labels=Path(snakemake.input.labels),
        rendered=Path(snakemake.input.rendered),
        comparisons=list_of_paths(snakemake.output.comparisons),
        contacts=list_of_paths(snakemake.output.contacts),
    )
