"""Draw photo and twins near opposition and far from it."""

from pathlib import Path

from polarsim.grid import GridOptions
from polarsim.report.of_run import draw_opposition_of_run
from polarsim.reporting import reporting
from polarsim.scoring.options import TablesOptions

with reporting(log=snakemake.log[0]):
    draw_opposition_of_run(
        terrains=snakemake.params.terrains,
        run=Path("results") / snakemake.wildcards.run,
        photo_domain=snakemake.params.photo_domain,
        models=snakemake.params.models,
        grid=GridOptions(**snakemake.params.grid),
        positions=snakemake.params.positions,
        figure=Path(snakemake.output.figure),
        words=Path(snakemake.output.words),
        options=TablesOptions(**snakemake.params.options),
    )
