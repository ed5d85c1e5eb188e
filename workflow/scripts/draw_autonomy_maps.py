"""Draw an autonomous drive per mode with map and images."""

from pathlib import Path

from polarsim.job_files import list_of_paths
from polarsim.report.figures.autonomy_maps import draw_autonomy_maps
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    draw_autonomy_maps(
        folders=[path.parent for path in list_of_paths(snakemake.input.drives)],
        figure=Path(snakemake.output.figure),
        origin=snakemake.params.origin,
    )
