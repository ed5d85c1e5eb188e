"""Points of scans in the sandbox frame, and extents of its floor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.geometry.poses import Pose
from polarsim.site_parts import Sandbox

# Objects at the rim that are higher are walls: metres above the sand, and share of the lowest wall.
WALL_FOOT, FOOT_SHARE = 0.12, 0.5


def wall_foot(sandbox: Sandbox) -> float:
    """Return the height above the sand at which points at the rim of a sandbox belong to walls, metres."""
    return min([WALL_FOOT, *(FOOT_SHARE * height for height in sandbox.walls_m.values() if height)])


@dataclass(frozen=True)
class ScanPoints:
    """Points of one or several scans in the sandbox frame, metres."""

    points: np.ndarray  # (n, 3)
    to_scanner: np.ndarray  # (n, 3) unit vectors towards the scanner of each point
    weights: np.ndarray  # (n,) 1 / range^2: near scans are denser and less affected by errors of poses

    def __len__(self) -> int:
        return len(self.points)

    def select(self, chosen: np.ndarray) -> ScanPoints:
        """Select points by a mask or an index array (n,)."""
        numbers = np.flatnonzero(chosen) if chosen.dtype == bool else chosen
        points, to_scanner = (values.take(numbers, axis=0) for values in (self.points, self.to_scanner))
        return ScanPoints(points, to_scanner, self.weights[numbers])

    def scanner(self, points: np.ndarray) -> np.ndarray:
        """Return the index (n,) of the scanner of each point, given the positions (s, 3) of scanners, metres."""
        away = points[:, None] - self.points  # (s, n, 3)
        along = np.einsum("snk,nk->sn", away, self.to_scanner) / np.linalg.norm(away, axis=-1)
        return np.asarray(along.argmax(axis=0))

    def moved(self, pose: Pose) -> ScanPoints:
        """Apply a rigid motion to the points."""
        return ScanPoints(pose.apply(self.points), pose.rotate(self.to_scanner), self.weights)


@dataclass(frozen=True)
class Extent:
    """Rectangle of the sandbox's floor, metres."""

    x0: float
    y0: float
    x1: float
    y1: float

    def grown(self, margin: float) -> Extent:
        return Extent(self.x0 - margin, self.y0 - margin, self.x1 + margin, self.y1 + margin)

    def snapped(self, cell: float) -> Extent:
        """Return the largest extent inside with multiples of `cell` as limits: grids with the same cell coincide."""
        low, high = (
            np.ceil(np.array([self.x0, self.y0]) / cell - 1e-6),
            np.floor(np.array([self.x1, self.y1]) / cell + 1e-6),
        )
        return Extent(*(low * cell).tolist(), *(high * cell).tolist())

    def contains(self, points: np.ndarray) -> np.ndarray:
        """Return whether points (n, 2 or 3) are inside, (n,)."""
        x, y = points[:, 0], points[:, 1]
        return (x >= self.x0) & (x <= self.x1) & (y >= self.y0) & (y <= self.y1)


def scan_in_sandbox(points_left: np.ndarray, sandbox_from_left: Pose) -> ScanPoints:
    """Transform a scan's points (n, 3) from the frame of the scanner's camera to the sandbox frame."""
    distance = np.linalg.norm(points_left, axis=1)
    to_scanner = sandbox_from_left.rotate(-points_left / distance[:, None])
    return ScanPoints(sandbox_from_left.apply(points_left), to_scanner, distance**-2)


def merge_scans(scans: list[ScanPoints]) -> ScanPoints:
    """Concatenate the points of several scans."""
    return ScanPoints(
        np.concatenate([scan.points for scan in scans] or [np.zeros((0, 3))]),
        np.concatenate([scan.to_scanner for scan in scans] or [np.zeros((0, 3))]),
        np.concatenate([scan.weights for scan in scans] or [np.zeros(0)]),
    )
