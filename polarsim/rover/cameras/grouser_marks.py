"""What grousers leave in a rut: a groove across it wherever one of them stood straight down.

The drive's soil knows smooth wheels; marks are added to the pictures' ground alone. They lie as far apart as the wheel
really rolled and slipped, and a wheel that comes second wipes out those of the first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from polarsim.rover.cameras.tracks import WheelTracks

DEPTH_M, SD_M = 0.006, 0.006  # of a mark, and the standard deviation of its profile along the rut
_EDGE_M = 0.01  # over which a mark ends at the wheel's side


@dataclass(frozen=True)
class GrouserMark:
    """One groove: when, where (2,), and which way (2,) the wheel was heading there."""

    time_s: float
    position: np.ndarray
    ahead: np.ndarray


@dataclass(frozen=True)
class Tread:
    """A wheel's grousers, and the grooves that they leave; metres."""

    grousers: int
    radius: float
    width: float
    depth: float
    sd: float  # of a groove's Gaussian profile along the rut

    @property
    def spacing(self) -> float:
        """Of marks where the wheel does not slip."""
        return 2 * np.pi * self.radius / self.grousers


def marks_of(
    time_s: np.ndarray, spin: np.ndarray, centres: np.ndarray, quaternions: np.ndarray, soil: np.ndarray, grousers: int
) -> list[GrouserMark]:
    """The marks of a wheel along its way.

    Parameters
    ----------
    time_s, spin : (n,)
        Moments, and how far the wheel had rotated by then, radians.
    centres, quaternions : (n, 3), (n, 4)
        Of the wheel; its axle is the y axis, quaternions are w, x, y, z.
    soil : (n,) bool
        It stands on soil.
    """
    strikes = spin * grousers / (2 * np.pi)
    axle = Rotation.from_quat(quaternions[:, [1, 2, 3, 0]]).apply([0.0, 1, 0])
    ahead = np.stack([axle[:, 1], -axle[:, 0]], axis=1)  # axle x up: level
    found = []
    for row in np.flatnonzero(np.floor(strikes[1:]) != np.floor(strikes[:-1])):
        if not soil[row]:
            continue
        whole = max(np.floor(strikes[row]), np.floor(strikes[row + 1]))
        share = (whole - strikes[row]) / (strikes[row + 1] - strikes[row])
        position = centres[row, :2] + share * (centres[row + 1, :2] - centres[row, :2])
        direction = ahead[row] / max(np.linalg.norm(ahead[row]), 1e-9)
        found.append(GrouserMark(float(time_s[row] + share * (time_s[row + 1] - time_s[row])), position, direction))
    return found


def stamp(tracks: WheelTracks, events: Sequence[GrouserMark], tread: Tread) -> None:
    """Write marks into the tracks, in their order."""
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
