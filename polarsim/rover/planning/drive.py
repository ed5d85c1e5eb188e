"""Run an autonomous drive, or a blind drive along the straight line, and write its files.

A folder contains the trace of the drive, `map.npz` (the rover's map at the end of the drive) and `pictures/`, of the
front camera with detected rocks, by milliseconds. The map of a blind drive has no observations. `localisation/`
contains `estimate.parquet` and `sensors.parquet`; it is empty if the pose is known.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from polarsim.formats import tables
from polarsim.formats.files import write_bytes, writing_folder
from polarsim.formats.npz import write_arrays
from polarsim.photo import COLOURS, ROCK
from polarsim.render.hits import one_blas_thread
from polarsim.render.options import RenderOptions
from polarsim.rover.cameras.options import CameraSuiteOptions, ImagingCondition
from polarsim.rover.drive.energy import EnergyError
from polarsim.rover.drive.job import DriveJob, job_of, straight_line, widened
from polarsim.rover.drive.options import DriveOptions
from polarsim.rover.drive.ride import RunningDrive
from polarsim.rover.drive.trace import Trace, write_trace
from polarsim.rover.localisation.localiser import Localiser
from polarsim.rover.localisation.stereo_motion import StereoMotion
from polarsim.rover.perception.hazard_grid import HazardGrid
from polarsim.rover.perception.observation import Perception
from polarsim.rover.perception.options import Mode, OnboardDetector
from polarsim.rover.planning.options import AutonomyOptions, PoseSource
from polarsim.rover.planning.pilot import OBSERVATIONS_HZ, Pilot
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.world.options import WorldOptions
from polarsim.run_files.localisation import ESTIMATE, LOCALISATION, SENSORS
from polarsim.schemas.rover import FUSED, ODOMETRY

_LOG_HZ = 20.0
_CHUNK_S = 10.0
MAP, PICTURES = "map.npz", "pictures"
WIDTH_PX = 640  # of the pictures
_QUALITY = 85
_BOX = COLOURS[ROCK][::-1]  # blue, green, red


@dataclass(frozen=True)
class Outcome:
    """A finished drive; `pilot` is None for a blind drive."""

    trace: Trace
    pilot: Pilot | None
    cpu_s: float  # of the entire drive
    wall_s: float
    localiser: Localiser | None = None  # None if the pose is known


def job_for(
    *,
    meshes: Path,
    world: WorldOptions,
    soil: SoilOptions,
    drive: DriveOptions,
    options: AutonomyOptions,
    seed: int,
    parts: Path | None = None,
) -> DriveJob:
    """Return a drive over the ground of a run, widened before, behind and at the sides of the path; see `job_of`."""
    world, drive = widened(world, drive, options.width_m)
    return job_of(meshes=meshes, world=world, soil=soil, drive=drive, seed=seed, parts=parts)


def autonomous_job(job: DriveJob, options: AutonomyOptions) -> DriveJob:
    """Return the drive along the straight line on which modes are compared, with the logging of autonomous drives."""
    changed = {
        "path_m": straight_line(job.world_options, job.drive),
        "speed_m_s": options.speed_m_s,
        "longest_s": options.longest_s,
    }
    drive = job.drive.model_copy(update=changed | {"picture_hz": OBSERVATIONS_HZ})
    return replace(job, drive=drive, log_hz=_LOG_HZ)


def write_outcome(folder: Path, outcome: Outcome, options: AutonomyOptions) -> None:
    """Write the files of a drive; equal drives give equal bytes."""
    grid = outcome.pilot.grid if outcome.pilot else HazardGrid(outcome.trace.world)
    write_trace(folder, outcome.trace)
    write_arrays(
        folder / MAP, x_m=grid.x, y_m=grid.y, log_odds=grid.log_odds, seen=grid.seen, height_m=grid.height,
        surface_m=grid.surface_of_cells(), hazard=grid.hazards(options.planner.hazard_m),
    )  # fmt: skip
    with writing_folder(folder / LOCALISATION) as temporary:
        if outcome.localiser is not None:
            tables.write_parquet(temporary / ESTIMATE, outcome.localiser.estimate())
            tables.write_parquet(temporary / SENSORS, outcome.localiser.readings())
    with writing_folder(folder / PICTURES) as temporary:
        for time_s, observation in outcome.pilot.observations if outcome.pilot else []:
            if observation.shown is not None:
                write_bytes(temporary / f"{1000 * time_s:07.0f}.jpg", _with_boxes(observation.shown, observation.found))


def _with_boxes(grey: np.ndarray, boxes: np.ndarray) -> bytes:
    """Return a JPEG of a picture (h, w) uint8 with boxes (n, 4+) in pixels."""
    import cv2

    scale = WIDTH_PX / grey.shape[1]
    size = (WIDTH_PX, round(scale * grey.shape[0]))
    canvas = cv2.cvtColor(cv2.resize(grey, size, interpolation=cv2.INTER_AREA), cv2.COLOR_GRAY2BGR)
    for x0, y0, x1, y1 in np.rint(scale * boxes[:, :4]).astype(int):
        cv2.rectangle(canvas, (int(x0), int(y0)), (int(x1), int(y1)), _BOX, 2, cv2.LINE_AA)
    return bytes(cv2.imencode(".jpg", canvas, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1])


def run_autonomous_drive(
    job: DriveJob,
    mode: Mode,
    light: ImagingCondition,
    options: AutonomyOptions,
    cameras: CameraSuiteOptions,
    *,
    render: RenderOptions,
    pose: PoseSource = "truth",
    detector: OnboardDetector | None = None,
    threads: int = 1,
) -> Outcome:
    """Drive from the first point of a job's path to the last; `threads` render the pictures.

    With a pose that is not known the drive ends where the rover believes itself at the goal.
    """
    cpu, wall = time.process_time(), time.perf_counter()
    job = autonomous_job(job, options)
    driver: Pilot | None = None
    localiser: Localiser | None = None
    if mode != "blind":
        perception = Perception(
            job.world, job.vehicle, job.route, mode, light, cameras, job.seed,
            render=render, detector=detector, localised=pose == FUSED, threads=threads,
        )  # fmt: skip
        driver = Pilot(job.route, perception, options)
        if pose == FUSED:
            localiser = _with_stereo(job, perception)
    if pose == ODOMETRY:
        localiser = Localiser(job.vehicle, job.seed, job.soil_options.gravity_m_s2)
    ride = RunningDrive(job, driver, localiser)
    if driver is not None:
        driver.attach(ride.simulation, localiser)
    with one_blas_thread():  # matrices are small, so threads would be slower
        while ride.ended is None:
            try:
                ride.run_for(_CHUNK_S)
            except EnergyError as error:
                ride.ended, ride.reason = "energy", str(error)
            if driver is not None and driver.given_up and ride.ended is None:
                ride.ended, ride.reason = "gave up", "no path after backing off"
    return Outcome(ride.trace(), driver, time.process_time() - cpu, time.perf_counter() - wall, localiser)


def _with_stereo(job: DriveJob, perception: Perception) -> Localiser:
    """Return the localiser with stereo motions of the pictures that a perception takes."""
    rig = perception.rectification
    return Localiser(
        job.vehicle, job.seed, job.soil_options.gravity_m_s2,
        stereo=StereoMotion(rig),
        base_from_camera=perception.left.base_from_camera @ rig.left_from_rectified,
    )  # fmt: skip
