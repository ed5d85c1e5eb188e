"""A drive along a path: commands, log, ground changes and termination."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from polarsim.errors import RoverError
from polarsim.rover.drive.control import Driver
from polarsim.rover.drive.energy import EnergyError
from polarsim.rover.drive.job import DriveJob, job_of, require_on_grid
from polarsim.rover.drive.options import DriveOptions
from polarsim.rover.drive.simulation import Simulation
from polarsim.rover.drive.state import OffGridError, RoverState
from polarsim.rover.drive.trace import LevelChanges, Trace, trace_table, write_trace
from polarsim.rover.soil.nodes import LEVEL
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.vehicle.table import WHEELS
from polarsim.rover.world.options import WorldOptions

CONTROL_HZ = 100.0  # commands per second
STUCK_S, STUCK_SHARE = 10.0, 0.05  # stuck: less than this share of the commanded progress in this time, s
SETTLE_S = 2.0  # time at rest before time 0, in which the rover sinks into the soil
REPORT_EVERY_S = 10.0  # simulated time between reports of progress
MIN_LEVEL_CHANGE = 1e-5  # m: smaller changes of the ground are not stored
Progress = Callable[[float], None]  # completed share of the path, 0 to 1


def run_drive(
    *,
    meshes: Path,
    folder: Path,
    world: WorldOptions,
    soil: SoilOptions,
    drive: DriveOptions,
    seed: int,
    parts: Path | None = None,
    progress: Progress | None = None,
) -> Trace:
    """Drive over the meshes of a run and write its files, see `job_of` and `drive_to_end`."""
    job = job_of(meshes=meshes, world=world, soil=soil, drive=drive, seed=seed, parts=parts)
    return drive_to_end(job, folder, progress)


def drive_to_end(job: DriveJob, folder: Path, progress: Progress | None = None) -> Trace:
    """Drive to the end and write the files.

    A path that leaves the grid and a time step that is too large are errors before the drive. With an open energy
    balance (`EnergyError`) the drive up to this time is written.
    """
    ride, failure = RunningDrive(job), None
    while ride.ended is None:
        try:
            ride.run_for(REPORT_EVERY_S)
        except EnergyError as error:
            failure, ride.ended, ride.reason = error, "energy", str(error)
        if progress:
            progress(min(max(ride.driver.done / ride.driver.path.length, 0.0), 1.0))
    trace = ride.trace()
    write_trace(folder, trace)
    if failure:
        raise failure
    return trace


class PoseEstimator(Protocol):
    """Source of the pose by which a driver steers; see `localisation.localiser`."""

    def read(self, state: RoverState) -> None:
        """Read the sensors at a state."""

    def log(self) -> None:
        """Store the estimate of the last state that was read."""

    @property
    def plane_pose(self) -> tuple[float, float, float]:
        """Estimated x, y, m, and heading, rad."""


class RunningDrive:
    """A running drive; by default the driver follows the job's path and the pose is known."""

    def __init__(self, job: DriveJob, driver: Driver | None = None, estimator: PoseEstimator | None = None) -> None:
        require_on_grid(job)
        self.job, self.route = job, job.route
        self.driver, self.estimator = driver or Driver(job.route, job.law), estimator
        self.simulation = Simulation(job.world, job.vehicle, job.soil, job.soil_options, job.start, job.rock_parts)
        dt = self.simulation.dt
        self._every = {what: _steps(hz, dt) for what, hz in (("control", CONTROL_HZ), ("log", job.log_hz))}
        self.rows: list[np.ndarray] = []
        self.headway: list[float] = []  # m, per row
        self.moving_since = 0  # row from which progress is expected
        self.frames: list[tuple[float, np.ndarray, np.ndarray]] = []
        self._stored_level = job.world.level.copy()
        self.step = 0
        self.settled = False
        self.ended: str | None = None
        self.reason = ""

    def run_for(self, seconds: float) -> None:
        """Drive for a given time, or to the end; an open energy balance is an `EnergyError`."""
        until = self.step + max(round(seconds / self.simulation.dt), 1)
        try:
            if not self.settled:
                self._settle()
            while self.ended is None and self.step < until:
                self._run_scheduled()
                if self.ended is None:
                    ahead = min(self._next_scheduled_step(), until)
                    self.simulation.advance((ahead - self.step) * self.simulation.dt)
                    self.step = ahead
        except OffGridError as error:
            self.ended, self.reason = "off the grid", str(error)

    def trace(self) -> Trace:
        """Return the trace up to the current step."""
        return Trace(trace_table(np.array(self.rows)), self.job.world, _tracks(self.frames), self._summary())

    def _settle(self) -> None:
        steps = round(SETTLE_S / self.simulation.dt)
        for first in range(0, steps, self._every["control"]):
            count = min(self._every["control"], steps - first)
            self.simulation.advance(count * self.simulation.dt)
        self.simulation.zero()
        self.settled = True

    def _run_scheduled(self) -> None:
        """Run what is scheduled for this step: command, row of the log, changes of the ground, end."""
        if self.step % self._every["control"] == 0:
            self.simulation.apply(self.driver.command(*self._plane_pose()))
        if self.step % self._every["log"] == 0:
            state = self.simulation.state()
            self.rows.append(state.row(self.driver.offset, self.driver.heading_error))
            self.headway.append(self.driver.headway)
            if self.estimator is not None:
                self.estimator.log()
            self._check_headway()
        if self.step == self._frame_step(len(self.frames)):
            self._store_ground()
        if self.driver.finished:
            self.ended = "finished"

    def _plane_pose(self) -> tuple[float, float, float]:
        """Return x, y and heading as the driver knows them."""
        if self.estimator is not None:
            self.estimator.read(self.simulation.state())
            return self.estimator.plane_pose
        x, y = self.simulation.data.qpos[:2]
        return float(x), float(y), self.simulation.heading

    def _check_headway(self) -> None:
        """End the drive if the rover is stuck or the time is over."""
        options, row = self.job.drive, len(self.headway) - 1
        if self.driver.turning:
            self.moving_since = row
        span = round(STUCK_S / self._every["log"] / self.simulation.dt)
        if row - self.moving_since >= span:
            headway = self.headway[row] - self.headway[row - span]
            if headway < STUCK_SHARE * options.speed_m_s * STUCK_S:
                self.ended = "stuck"
                self.reason = f"{100 * headway:.1f} cm of headway in the last {STUCK_S:g} s"
        longest = options.longest_s or 4 * self.route.length / options.speed_m_s
        if self.simulation.time >= longest:
            self.ended, self.reason = "out of time", f"the end of the path was not reached after {longest:g} s"

    def _store_ground(self) -> None:
        """Store the cells of the ground that changed since the last frame."""
        level = self.simulation.ground.state[..., LEVEL].astype(np.float32)
        cells = np.flatnonzero(np.abs(level - self._stored_level) > MIN_LEVEL_CHANGE).astype(np.int32)
        levels = level.ravel()[cells]
        self._stored_level.ravel()[cells] = levels
        self.frames.append((self.simulation.time, cells, levels))

    def _frame_step(self, frame: int) -> int:
        return round(frame / self.job.drive.picture_hz / self.simulation.dt)

    def _next_scheduled_step(self) -> int:
        """Return the next step for which something is scheduled."""
        due = [(self.step // every + 1) * every for every in self._every.values()]
        return min(*due, max(self._frame_step(len(self.frames)), self.step + 1))

    def _summary(self) -> dict[str, Any]:
        account, job = self.simulation.account, self.job
        return {
            "ended": self.ended or "under way",
            "reason": self.reason,
            "seed": job.seed,
            "seconds": round(self.simulation.time, 9),
            "path_m": self.route.points.tolist(),
            "along_m": self.driver.done,
            "soil": vars(self.simulation.soil),
            "options": {
                name: part.model_dump(mode="json")
                for name, part in (("drive", job.drive), ("soil", job.soil_options), ("world", job.world_options))
            },
            "energy_j": {
                **{name: getattr(account, name) for name in ("motor", "soil", "damper", "rock", "change", "missing")},
                "motor_of": dict(zip(WHEELS, account.motor_of, strict=True)),
                "soil_of": dict(zip(WHEELS, account.soil_of, strict=True)),
            },
            "energy_open": account.open,
            "contacts": self.simulation.contacts().to_dict("records"),
            "rock_shapes": self.simulation.rock_shapes,
            "steps": self.simulation.steps,
            "rows": len(self.rows),
            "frames": len(self.frames),
        }


def _steps(hz: float, dt: float) -> int:
    steps = round(1 / hz / dt)
    if steps < 1:
        raise RoverError(f"a rate of {hz:g} per second needs a step below {1000 * dt:g} ms")
    return steps


def _tracks(frames: list[tuple[float, np.ndarray, np.ndarray]]) -> LevelChanges:
    counts = [len(cells) for _, cells, _ in frames]
    return LevelChanges(
        np.array([time for time, _, _ in frames]),
        np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        np.concatenate([np.zeros(0, np.int32), *(cells for _, cells, _ in frames)]),
        np.concatenate([np.zeros(0, np.float32), *(levels for _, _, levels in frames)]),
    )
