"""Files of a drive: a row per logged time, changes of the ground at picture times, and the summary `drive.json`."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from polarsim.errors import FormatError
from polarsim.formats import tables
from polarsim.formats.files import read_json, write_json
from polarsim.formats.npz import read_arrays, write_arrays
from polarsim.geometry.poses import Pose
from polarsim.geometry.trajectories import Trajectory
from polarsim.rover.vehicle.table import WHEELS
from polarsim.rover.world.surface import World, read_world, write_world

CONTACTS = ("none", "soil", "rock", "both")  # kinds of contact of a wheel
BODY_COLUMNS = (
    "time_s", "x_m", "y_m", "z_m", "qw", "qx", "qy", "qz",  # base_link in the world
    "vx_m_s", "vy_m_s", "vz_m_s", "wx_rad_s", "wy_rad_s", "wz_rad_s",  # world; base_link
    "ax_m_s2", "ay_m_s2", "az_m_s2",  # reading of an accelerometer at base_link's origin, with gravity, without noise
    "offset_m", "heading_error_rad", "command_speed_m_s", "command_steer_rad", "command_crab_rad",
    "energy_open",
)  # fmt: skip
WHEEL_COLUMNS = (
    "steer_rad", "lift_m", "spin_rad", "spin_rad_s", "x_m", "y_m", "z_m", "qw", "qx", "qy", "qz",
    "slip", "sinkage_m", "sinkage_first_m", "load_n", "torque_n_m", "contact",
)  # fmt: skip
COLUMNS = BODY_COLUMNS + tuple(f"{code}_{name}" for code in WHEELS for name in WHEEL_COLUMNS)
# Rows of `contacts` in drive.json, see `Simulation.contacts`.
CONTACT_COLUMNS = ("rock", "part", "link", "time_s", "duration_s", "impulse_n_s")
GROUND = -1  # number of the ground among the rocks of contacts
TRACK_ARRAYS = ("time_s", "start", "cell", "level_m")  # of `LevelChanges`
TRACE, TRACKS, DRIVE, WORLD = "trace.parquet", "tracks.npz", "drive.json", "world"


class LevelChanges(NamedTuple):
    """Changes of the ground by frame: cells that changed since the last frame, and their new levels."""

    time: np.ndarray  # (F,) s
    start: np.ndarray  # (F + 1,) index of a frame's first cell
    cell: np.ndarray  # (n,) int32, row * columns + column
    level: np.ndarray  # (n,) float32, m

    def apply(self, frame: int, level: np.ndarray) -> None:
        """Update a grid from the last frame to this frame, in place."""
        part = slice(self.start[frame], self.start[frame + 1])
        level.ravel()[self.cell[part]] = self.level[part]


@dataclass(frozen=True)
class Trace:
    """Recorded drive."""

    table: pd.DataFrame  # `COLUMNS`
    world: World
    tracks: LevelChanges
    drive: dict[str, Any] = field(default_factory=dict)  # drive.json

    def pose_at(self, time_s: float, wheel: str | None = None) -> Pose:
        """Return the interpolated `world_from_base`, or `world_from_wheel` for the code of a wheel."""
        path = self._paths[wheel or ""]
        return path.at(np.clip([time_s], path.times[0], path.times[-1])).pose(0)

    def value_at(self, time_s: float, column: str) -> float:
        """Return the interpolated value of a column."""
        return float(np.interp(time_s, self.table["time_s"], self.table[column]))

    @cached_property
    def _paths(self) -> dict[str, Trajectory]:
        times = self.table["time_s"].to_numpy()
        paths = {}
        for wheel in ("", *WHEELS):
            prefix = f"{wheel}_" if wheel else ""
            translations = self.table[[f"{prefix}{name}" for name in ("x_m", "y_m", "z_m")]].to_numpy()
            quaternions = self.table[[f"{prefix}{name}" for name in ("qx", "qy", "qz", "qw")]].to_numpy()
            paths[wheel] = Trajectory(times, translations, Rotation.from_quat(quaternions))
        return paths


def trace_table(rows: np.ndarray) -> pd.DataFrame:
    """Return the table of rows (n, len(COLUMNS)) in the order of `COLUMNS`; contacts are indices in `CONTACTS`."""
    table = pd.DataFrame(rows.reshape(-1, len(COLUMNS)), columns=list(COLUMNS))
    for name in (f"{code}_contact" for code in WHEELS):
        table[name] = np.array(CONTACTS, dtype=object)[table[name].to_numpy(int)]
    return table


def rock_contacts(trace: Trace) -> pd.DataFrame:
    """Return the contacts of a drive with rocks, see `Simulation.contacts`, with height and position of the rock."""
    rocks = trace.world.rocks[["rock", "height_m", "x_m", "y_m"]].astype({"rock": int})
    contacts = pd.DataFrame(trace.drive["contacts"], columns=list(CONTACT_COLUMNS))
    return contacts[contacts["rock"] != GROUND].astype({"rock": int}).merge(rocks, on="rock")


def write_trace(folder: str | Path, trace: Trace) -> None:
    """Write all files of a drive; equal drives give equal bytes."""
    folder = Path(folder)
    write_world(folder / WORLD, trace.world)
    tables.write_parquet(folder / TRACE, trace.table[list(COLUMNS)])
    write_arrays(folder / TRACKS, **dict(zip(TRACK_ARRAYS, trace.tracks, strict=True)))
    write_json(folder / DRIVE, trace.drive)


def read_trace(folder: str | Path) -> Trace:
    """Read the folder of a drive; a missing or invalid file is a `FormatError`."""
    folder = Path(folder)
    world = read_world(folder / WORLD)
    table = tables.read_parquet(folder / TRACE, COLUMNS)
    if len(table) < 2:
        raise FormatError(f"{len(table)} rows, a drive has at least two", path=folder / TRACE)
    arrays = read_arrays(folder / TRACKS, TRACK_ARRAYS)
    tracks = LevelChanges(*(arrays[name] for name in TRACK_ARRAYS))
    if len(tracks.start) != len(tracks.time) + 1 or (len(tracks.cell) and tracks.cell.max() >= world.level.size):
        raise FormatError(f"cells do not belong to the ground of {world.level.shape} nodes", path=folder / TRACKS)
    return Trace(table, world, tracks, read_json(folder / DRIVE))
