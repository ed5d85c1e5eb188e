"""Simulate an autonomous drive."""

from pathlib import Path

from polarsim.job_files import list_of_paths
from polarsim.render.options import RenderOptions
from polarsim.reporting import reporting
from polarsim.rover.cameras.options import CameraSuiteOptions
from polarsim.rover.drive.options import DriveOptions
from polarsim.rover.perception.options import onboard_detector
from polarsim.rover.planning.options import AutonomyOptions
from polarsim.rover.planning.summary import drive_case
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.world.options import WorldOptions

with reporting(log=snakemake.log[0]):
    drive_case(
        case=snakemake.wildcards.case,
        meshes=list_of_paths(snakemake.input.meshes)[0].parent,
        parts=Path(snakemake.input.parts),
        folder=Path(snakemake.output.figures).parent,
        world=WorldOptions(**snakemake.params.world),
        soil=SoilOptions(**snakemake.params.soil),
        drive_options=DriveOptions(**snakemake.params.drive_options),
        options=AutonomyOptions(**snakemake.params.options),
        cameras=CameraSuiteOptions(**snakemake.params.cameras),
        render=RenderOptions(**snakemake.params.render),
        detector=onboard_detector(snakemake.params.detector),
        threads=snakemake.threads,
    )
