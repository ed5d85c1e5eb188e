"""Run all steps of a drive, from meshes to its bag."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pandas as pd

from polarsim.render.options import RenderOptions
from polarsim.rover.cameras.frames import render_frames
from polarsim.rover.drive.ride import run_drive
from polarsim.rover.drive.table import rover_metrics
from polarsim.rover.export.bag import write_bag
from polarsim.rover.export.replay import write_estimates
from polarsim.rover.export.sequence import write_sensors
from polarsim.rover.export.urdf import write_urdf
from polarsim.rover.export.video import write_videos
from polarsim.rover.options import RoverOptions
from polarsim.rover.perception.detections import detect_drive
from polarsim.rover.perception.measure import measure_drive
from polarsim.rover.perception.options import OnboardDetector
from polarsim.rover.vehicle.table import read_vehicle

BAG, URDF = "drive.mcap", "rover.urdf"


def run_drive_pipeline(
    *,
    meshes: Path,
    folder: Path,
    options: RoverOptions,
    render: RenderOptions,
    detector: OnboardDetector | None,
    seed: int,
    progress: Callable[[float], None] | None = None,
    pictures: bool = True,
    threads: int = 1,
) -> pd.DataFrame:
    """Drive and write all files of the drive; return `rover_metrics`.

    Steps: physics, URDF, sensors, pictures, onboard detector, estimated poses, bag.
    """
    trace = run_drive(
        meshes=meshes, folder=folder, world=options.world, soil=options.soil, drive=options.drive, seed=seed,
        progress=progress,
    )  # fmt: skip
    vehicle, suite = read_vehicle(options.drive.vehicle), options.cameras
    write_urdf(folder / URDF, vehicle)
    write_sensors(folder, trace, vehicle, suite.views if pictures else (), suite.scale, seed)
    if pictures:
        render_frames(folder, vehicle, suite, seed, threads, render=render)
        if options.onboard:
            if detector is not None:
                detect_drive(folder, vehicle, suite, detector, seed, threads)
            measure_drive(folder, vehicle, suite, detector, seed)
        if suite.videos:
            write_videos(folder, vehicle, suite, seed, threads)
    write_estimates(folder, trace, vehicle, options.picture_sets if pictures else (), seed)
    if options.bags:
        write_bag(folder, folder / BAG, vehicle, options.bag)
    return rover_metrics(trace)
