"""Cut the rocks of a run's drives into convex parts."""

from pathlib import Path

from polarsim.job_files import list_of_paths
from polarsim.reporting import reporting
from polarsim.rover.drive.job import cut_rocks
from polarsim.rover.drive.options import DriveOptions
from polarsim.rover.world.options import WorldOptions

with reporting(log=snakemake.log[0]):
    cut_rocks(
        meshes=list_of_paths(snakemake.input.meshes)[0].parent,
        parts=Path(snakemake.output.parts),
        world=WorldOptions(**snakemake.params.world),
        drive=DriveOptions(path_m=snakemake.params.path_m),
        autonomous_width_m=snakemake.params.autonomous_width_m,
    )
