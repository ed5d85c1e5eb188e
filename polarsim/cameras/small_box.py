"""Sandbox frame of a terrain without survey, from a raised box of sand on the floor.

In a height map, the box is a raised rectangle of known size with upright sides. Its centre is the origin, the sand is
at z = 0, +Z is the normal of the floor, and +X points to the side that faces the cameras. If the sides differ, the long
side defines the axes, and the cameras decide between opposite headings.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy import ndimage

from polarsim.cameras.heightmaps import height_map
from polarsim.geometry.planes import level_from, tracked_plane
from polarsim.geometry.poses import Pose

SEARCH_MARGIN, MAP_CELL = 2.5, 0.02  # width of the searched floor around the box, and side of a cell, metres
MIN_BOX_HEIGHT = 0.08  # minimum height of the box above the floor, metres
MAX_GAP = 0.06  # maximum width of closed gaps, metres; rocks and walls occlude parts of the box
SIZE_SLACK = 0.3  # maximum relative error of a side of the box
SQUARE = 0.8  # minimum share of the bounding rectangle that the box covers
LONG_SIDE = 1.1  # minimum ratio of the sides of a box whose long side defines the heading
SAND_SHARE = 0.8  # of the half width; farther out are walls and piles of sand
PLANE_SCALES = [0.10, 0.08, 0.06, 0.05, 0.04, 0.03, 0.03, 0.03]  # metres: scales of the robust fits of floor and sand


def small_box_frame(points: np.ndarray, half: np.ndarray, cameras: Iterable[Pose]) -> Pose | None:
    """Return `sandbox_from_level` from scans (n, 3) in a level frame, metres; None if there is no such box.

    `half` (2,): half the width of the box along X and Y, metres.
    `cameras`: `level_from_left` of the scanned positions.
    """
    reach = float(half.max()) + SEARCH_MARGIN
    upright = _level_floor(points, reach)
    points = upright.apply(points)
    centre, heading = _box(height_map(points, reach, MAP_CELL).height, half, reach)
    if centre is None:
        return None
    home = Pose.from_rotvec(np.array([0, 0, -heading]), np.zeros(3)) @ Pose(np.eye(3), -np.append(centre, 0.0))
    forward = sum(((home @ upright @ pose).rotation @ [0.0, 0.0, 1.0] for pose in cameras), np.zeros(3))
    step = 1 if half.max() < LONG_SIDE * half.min() else 2
    quarters = step * round((np.pi - np.arctan2(forward[1], forward[0])) / (step * np.pi / 2))  # optical axes along -X
    home = Pose.from_rotvec(np.array([0, 0, quarters * np.pi / 2]), np.zeros(3)) @ home
    moved = home.apply(points)
    sand = moved[(np.abs(moved[:, :2]) < SAND_SHARE * half).all(axis=1)]
    plane = tracked_plane(sand, np.array([0, 0, np.median(sand[:, 2])]), PLANE_SCALES)
    return Pose(np.eye(3), np.array([0, 0, -plane[2]])) @ home @ upright


def _level_floor(points: np.ndarray, reach: float) -> Pose:
    """Return the rotation and translation that make the floor level, at z = 0.

    The sand of a small box is less accurate: its relief tilts a plane by a degree.
    """
    near = points[(np.abs(points[:, :2]) < reach).all(axis=1)]
    floor = _floor(height_map(points, reach, MAP_CELL).height)
    return level_from(tracked_plane(near[:: max(1, len(near) // 100_000)], np.array([0, 0, floor]), PLANE_SCALES))


def _box(heights: np.ndarray, half: np.ndarray, reach: float) -> tuple[np.ndarray | None, float]:
    """Return the centre (2,) of the box in a height map of +-`reach`, and the heading of its X axis, radians."""
    import cv2

    raised = np.nan_to_num(heights, nan=-np.inf) > _floor(heights) + MIN_BOX_HEIGHT
    raised = ndimage.binary_closing(raised, np.ones((3, 3), bool), iterations=round(MAX_GAP / MAP_CELL / 2))
    raised = ndimage.binary_opening(raised, np.ones((5, 5), bool))  # removes objects that lean on the box
    parts, _ = ndimage.label(raised)
    best: tuple[float, np.ndarray | None, float] = (np.inf, None, 0.0)
    for number, window in enumerate(ndimage.find_objects(parts), 1):
        row, column = np.nonzero(parts[window] == number)
        cells = np.stack([column + window[1].start, row + window[0].start], axis=1).astype(np.float32)
        sides = cv2.minAreaRect(cells)[1]
        width = (np.array(sides) + 1) * MAP_CELL
        off = float(np.abs(np.sort(width) / (2 * np.sort(half)) - 1).max())
        if off < min(best[0], SIZE_SLACK) and len(cells) * MAP_CELL**2 > SQUARE * np.prod(width):
            best = off, *_by_area((cells + 0.5) * MAP_CELL - reach, half)
    return best[1:]


def _by_area(cells: np.ndarray, half: np.ndarray) -> tuple[np.ndarray, float]:
    """Return centre (2,) and heading of the X axis, radians, of a box of cells (n, 2).

    Moments of the area are used because the edges are ragged. The fourth moment of a square about its centre, the sum
    of (x + iy)^4, is real and negative in its axes. The second moment of a rectangle, the sum of (x + iy)^2, is real
    and positive along its long side.
    """
    centre = cells.mean(axis=0)
    x, y = (cells - centre).T
    if half.max() >= LONG_SIDE * half.min():
        long_side = float(np.angle(((x + 1j * y) ** 2).sum()) / 2)
        return centre, long_side + (0.0 if half[0] > half[1] else np.pi / 2)
    return centre, float(np.angle(-((x + 1j * y) ** 4).sum()) / 4)


def _floor(heights: np.ndarray) -> float:
    """Return the height of the floor: the centre of the fullest bin of 2 cm."""
    heights_of_cells = heights[np.isfinite(heights)]
    bins = np.floor(heights_of_cells / MAP_CELL).astype(int)
    return float((np.bincount(bins - bins.min()).argmax() + bins.min() + 0.5) * MAP_CELL)
