"""Draw a photo beside its twins."""

from pathlib import Path

from polarsim.photo import PhotoKey
from polarsim.report.of_run import draw_comparison_of_run
from polarsim.reporting import reporting
from polarsim.scoring.options import TablesOptions

with reporting(log=snakemake.log[0]):
    draw_comparison_of_run(
        key=PhotoKey.parse(snakemake.params.key),
        run=Path("results") / snakemake.wildcards.run,
        models=snakemake.params.models,
        figure=Path(snakemake.output.figure),
        options=TablesOptions(**snakemake.params.options),
    )
