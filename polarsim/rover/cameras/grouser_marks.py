"""Grooves that grousers press into a rut, each at the place where a grouser points straight down.

The soil of the drive has smooth wheels; marks are added to the rendered ground only. Their spacing follows the rotation
and slip of the wheel. Marks of a later wheel replace earlier marks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from polarsim.rover.cameras.tracks import WheelTracks

DEPTH_M, SD_M = 0.006, 0.006  # depth of a mark, and standard deviation of its profile along the rut
_EDGE_M = 0.01  # width of the transition at the side of the wheel


@dataclass(frozen=True)
class GrouserMark:
    """Time, position (2,) and heading (2,) of the wheel at a groove."""

    time_s: float
    position: np.ndarray
    ahead: np.ndarray


@dataclass(frozen=True)
class Tread:
    """Grousers of a wheel and the shape of their grooves; metres."""

    grousers: int
    radius: float
    width: float
    depth: float
    sd: float  # of a groove's Gaussian profile along the rut

    @property
    def spacing(self) -> float:
        """Distance between marks of a wheel without slip."""
        return 2 * np.pi * self.radius / self.grousers


def marks_of(
    time_s: np.ndarray, spin: np.ndarray, centres: np.ndarray, quaternions: np.ndarray, soil: np.ndarray, grousers: int
) -> list[GrouserMark]:
    """Return the marks of a wheel along its path.

    Parameters
    ----------
    time_s, spin : (n,)
        Times, and the rotation angle of the wheel, radians.
    centres, quaternions : (n, 3), (n, 4)
        Pose of the wheel; the axle is the y axis, quaternions are w, x, y, z.
    soil : (n,) bool
        The wheel touches soil.
    """
    strikes = spin * grousers / (2 * np.pi)
    axle = Rotation.from_quat(quaternions[:, [1, 2, 3, 0]]).apply([0.0, 1, 0])
    ahead = np.stack([axle[:, 1], -axle[:, 0]], axis=1)  # horizontal cross product of axle and up
    marks = []
    for row in np.flatnonzero(np.floor(strikes[1:]) != np.floor(strikes[:-1])):
        if not soil[row]:
            continue
        whole = max(np.floor(strikes[row]), np.floor(strikes[row + 1]))
        share = (whole - strikes[row]) / (strikes[row + 1] - strikes[row])
        position = centres[row, :2] + share * (centres[row + 1, :2] - centres[row, :2])
        direction = ahead[row] / max(np.linalg.norm(ahead[row]), 1e-9)
        marks.append(GrouserMark(float(time_s[row] + share * (time_s[row + 1] - time_s[row])), position, direction))
    return marks


def stamp(tracks: WheelTracks, events: Sequence[GrouserMark], tread: Tread) -> None:
    """Write marks into the tracks, in the given order."""
    lattice, fine, shape = tracks.lattice, tracks.fine.cell, np.array(tracks.fine.level.shape)
    reach = np.hypot(tread.spacing, tread.width) / 2 + fine
    for event in events:
        centre = (event.position[::-1] - [lattice.y0, lattice.x0]) / fine  # row, column
        low = np.clip(np.floor(centre - reach / fine).astype(int), 0, shape)
        high = np.clip(np.ceil(centre + reach / fine).astype(int) + 1, 0, shape)
        if (high <= low).any():
            continue
        rows, columns = slice(low[0], high[0]), slice(low[1], high[1])
        y, x = np.meshgrid(
            (np.arange(low[0], high[0]) - centre[0]) * fine,
            (np.arange(low[1], high[1]) - centre[1]) * fine,
            indexing="ij",
        )
        along = x * event.ahead[0] + y * event.ahead[1]
        across = np.abs(y * event.ahead[0] - x * event.ahead[1])
        fade = np.clip((tread.width / 2 - across) / _EDGE_M, 0, 1)
        depth = -tread.depth * np.exp(-0.5 * (along / tread.sd) ** 2) * fade * fade * (3 - 2 * fade)
        where = (np.abs(along) <= tread.spacing / 2) & (across <= tread.width / 2)
        tracks.stamp(rows, columns, depth.astype(np.float32), where)
