"""One drive in which the rover decides, or a blind one along the straight line, and its files.

A folder holds a drive's trace as any drive's does, `map.npz`: the rover's map as it was at the end, and `pictures/`. A
blind drive has a map on which nothing was seen.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from polarsim.formats.npz import write_arrays
from polarsim.render.hits import one_blas_thread
from polarsim.render.options import RenderOptions
from polarsim.rover.cameras.options import CameraSuiteOptions, Light
from polarsim.rover.drive.control import Path as Route
from polarsim.rover.drive.energy import EnergyError
from polarsim.rover.drive.job import Job, job_of, path_of
from polarsim.rover.drive.options import DriveOptions, Point
from polarsim.rover.drive.ride import Ride
from polarsim.rover.drive.trace import Trace, write_trace
from polarsim.rover.perception.hazard_grid import HazardGrid
from polarsim.rover.perception.observation import Perception
from polarsim.rover.perception.options import Mode, OnboardDetector
from polarsim.rover.planning.options import AutonomyOptions
from polarsim.rover.planning.pictures import write_pictures
from polarsim.rover.planning.pilot import OBSERVATIONS_HZ, Pilot, pilot
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.world.options import WorldOptions

_AHEAD_M = 3.0  # from the start to the first terrain, and from the last one to the end
_LOG_HZ = 20.0
_GO_ON_S = 10.0
_BEHIND_M = 1.5  # of ground behind the rover at the start: its rear wheels and some more
MAP, PICTURES = "map.npz", "pictures"


@dataclass(frozen=True)
class Outcome:
    """A drive as it was; without a pilot it was blind."""

    mode: Mode
    light: Light
    seed: int
    trace: Trace
    pilot: Pilot | None
    cpu_s: float  # of the whole
    wall_s: float


def job_for(
    *, meshes: Path, world: WorldOptions, soil: SoilOptions, drive: DriveOptions, options: AutonomyOptions, seed: int
) -> Job:
    """A drive over the same ground with room before, behind and beside the way.

    Raises
    ------
    PolarsimError
        Meshes, elevation model, soil or vehicle are missing or broken.
    """
    # The grid of an elevation model lies round the path, that of a strip round its terrains.
    room = {"width_m": options.width_m, "margin_m": _BEHIND_M + (0.0 if world.dem else _AHEAD_M)}
    drive = drive.model_copy(update={"path_m": _line(world, drive)})
    return job_of(meshes=meshes, world=world.model_copy(update=room), soil=soil, drive=drive, seed=seed)


def autonomous_job(job: Job, options: AutonomyOptions) -> Job:
    """The same drive on the straight line that modes are compared on, logged as autonomy asks for."""
    drive = job.drive.model_copy(
        update={
            "path_m": _line(job.rocks, job.drive),
            "speed_m_s": options.speed_m_s,
            "picture_hz": OBSERVATIONS_HZ,
            "longest_s": options.longest_s,
        }
    )
    return replace(job, drive=drive, log_hz=_LOG_HZ)


def _line(world: WorldOptions, drive: DriveOptions) -> tuple[Point, Point]:
    """The straight line from the path's first point to its last."""
    points = path_of(world, drive, _AHEAD_M)
    return points[0], points[-1]


def write(folder: Path, outcome: Outcome, options: AutonomyOptions) -> None:
    """The files of a drive: same drive, same bytes."""
    grid = outcome.pilot.grid if outcome.pilot else HazardGrid(outcome.trace.world)
    write_trace(folder, outcome.trace)
    write_arrays(
        folder / MAP, x_m=grid.x, y_m=grid.y, log_odds=grid.log_odds, seen=grid.seen, height_m=grid.height,
        surface_m=grid.surface_of_cells(), hazard=grid.hazards(options.planner.hazard_m),
    )  # fmt: skip
    write_pictures(folder / PICTURES, outcome.pilot.observations if outcome.pilot else [])


def drive(
    job: Job,
    mode: Mode,
    light: Light,
    options: AutonomyOptions,
    cameras: CameraSuiteOptions,
    *,
    render: RenderOptions,
    detector: OnboardDetector | None = None,
    threads: int = 1,
) -> Outcome:
    """Drive from the first point of a job's path to the last; `threads` render the pictures.

    Raises
    ------
    PolarsimError
        The path leaves the grid, no detector, an unknown light.
    """
    cpu, wall = time.process_time(), time.perf_counter()
    job = autonomous_job(job, options)
    route = Route(np.array(job.drive.path_m, float))
    driver: Pilot | None = None
    if mode != "blind":
        perception = Perception(
            job.world, job.vehicle, route, mode, light, cameras, job.seed,
            render=render, detector=detector, threads=threads,
        )  # fmt: skip
        driver = pilot(route, perception, options)
    ride = Ride(job, driver)
    if driver is not None:
        driver.attach(ride.simulation)
    with one_blas_thread():  # small products: threads cost more than they save
        while ride.ended is None:
            try:
                ride.go_on(_GO_ON_S)
            except EnergyError as error:
                ride.ended, ride.reason = "energy", str(error)
            if driver is not None and driver.given_up and ride.ended is None:
                ride.ended, ride.reason = "gave up", "no path after backing off"
    return Outcome(mode, light, job.seed, ride.trace(), driver, time.process_time() - cpu, time.perf_counter() - wall)
