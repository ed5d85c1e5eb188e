"""Draw the errors of one terrain's labels."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.tables.figures.labels import draw_label_errors
from polarsim.tables.options import TablesOptions

with reporting(log=snakemake.log[0]):
    draw_label_errors(
        terrain=int(snakemake.wildcards.terrain),
        labels=Path(snakemake.input.boxes),
        truth=Path(snakemake.params.truth),
        seeds=Path(snakemake.input.seeds),
        figure=Path(snakemake.output.figure),
        options=TablesOptions(**snakemake.params.options),
    )
