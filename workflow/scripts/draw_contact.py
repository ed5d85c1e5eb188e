"""Draw the contact sheet of a set-up."""

from pathlib import Path

from polarsim.grid import GridOptions
from polarsim.report.of_run import draw_contact_of_run
from polarsim.reporting import reporting
from polarsim.scoring.options import TablesOptions

with reporting(log=snakemake.log[0]):
    draw_contact_of_run(
        terrain=int(snakemake.wildcards.terrain),
        position=snakemake.wildcards.position,
        run=Path("results") / snakemake.wildcards.run,
        grid=GridOptions(**snakemake.params.grid),
        models=snakemake.params.models,
        figure=Path(snakemake.output.figure),
        options=TablesOptions(**snakemake.params.options),
    )
