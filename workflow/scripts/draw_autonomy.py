"""Draw metrics, paths and maps of autonomous drives for each mode."""

from pathlib import Path

from polarsim.job_files import list_of_paths
from polarsim.report.figures.autonomy import draw_autonomy
from polarsim.report.figures.autonomy_maps import draw_autonomy_maps
from polarsim.report.figures.autonomy_paths import draw_paths
from polarsim.reporting import reporting

folders = [path.parent for path in list_of_paths(snakemake.input.drives)]
with reporting(log=snakemake.log[0]):
    draw_autonomy(
        together=Path(snakemake.input.together), figure=Path(snakemake.output.figure), origin=snakemake.params.origin
    )
    draw_paths(folders=folders, figure=Path(snakemake.output.ways), origin=snakemake.params.origin)
    draw_autonomy_maps(folders=folders, figure=Path(snakemake.output.maps), origin=snakemake.params.origin)
