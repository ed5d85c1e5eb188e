"""Draw metrics and paths of autonomous drives for each mode."""

from pathlib import Path

from polarsim.job_files import list_of_paths
from polarsim.report.figures.autonomy import draw_autonomy
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    draw_autonomy(
        folders=[path.parent for path in list_of_paths(snakemake.input.drives)],
        together=Path(snakemake.input.together),
        figure=Path(snakemake.output.figure),
        ways=Path(snakemake.output.ways),
        origin=snakemake.params.origin,
    )
