"""Draw slip, sinkage and offset over time, and images at several times of a drive."""

from pathlib import Path

from polarsim.job_files import list_of_paths
from polarsim.report.figures.drive import draw_drive
from polarsim.report.figures.drive_images import draw_sequence
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    draw_drive(
        traces=list_of_paths(snakemake.input.traces),
        figure=Path(snakemake.output.figure),
        origin=snakemake.params.origin,
    )
    draw_sequence(
        view=Path(snakemake.input.poses).parent,
        pictures=snakemake.params.pictures,
        figure=Path(snakemake.output.sequence),
    )
