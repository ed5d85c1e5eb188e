"""Draw the contact sheet of a station."""

from pathlib import Path

from polarsim.grid import GridOptions, selected_grid
from polarsim.job_files import paths
from polarsim.report.figures.contact import draw_contact
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    draw_contact(
        keys=selected_grid(
            terrain=int(snakemake.wildcards.terrain),
            positions=[snakemake.wildcards.position],
            grid=GridOptions(**snakemake.params.grid),
        ),
        labels=Path(snakemake.input.labels),
        pictures=[Path(snakemake.input.photos), *paths(snakemake.input.twins)],
        figure=Path(snakemake.output.figure),
    )
