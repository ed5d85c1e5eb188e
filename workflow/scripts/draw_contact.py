"""Draw the contact sheet of a station."""

from polarsim.grid import selected_grid
from polarsim.job import job
from polarsim.report.figures.contact import draw_contact

with job(snakemake) as call:
    call(
        draw_contact,
        keys=call(selected_grid, positions=[snakemake.wildcards.position]),
        pictures=[snakemake.input.photos, *snakemake.input.twins],
    )
