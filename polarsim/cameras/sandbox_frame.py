"""The sandbox frame of aligned scans.

What scans alone leave open is settled so: +Z is the normal of a robust plane through the whole sand, and z = 0 its
height at the origin. Origin and heading come from the box: its inner walls lie at +-`SANDBOX_HALF_WIDTH` along X and
Y, and the survey says which wall is which: they are looked for about where the tripods put them, by the rotation and
translation that best lay these on their surveyed positions and headings. Where fewer than two walls at right angles are
seen, that is the frame.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from polarsim.cameras.heightmaps import height_map
from polarsim.geometry.planes import level_from, tracked_plane
from polarsim.geometry.poses import Pose, yaw_pitch_roll
from polarsim.survey import SANDBOX_HALF_WIDTH, SURELY_WALL

GROUND_STEP = 0.04  # metres: cells that weigh alike in the ground's plane
GROUND_SCALES = [0.3, 0.2, 0.15, 0.1, 0.08, 0.06, 0.05, 0.04, 0.04, 0.04]
GROUND_SHARE = 0.9  # of the half width: beyond it sand piles up at the walls

WALL_BAND = (0.06, SURELY_WALL)  # metres above the sand in which a wall is looked for: no foot, no top edge
WALL_SLACK = 0.6  # metres that a wall may be off its position before the frame is known
WALL_UPRIGHT = 0.3  # |z| of the normal of a wall, at most
WALL_FACING = 0.95  # cosine between a wall's normal and the axis
WALL_THICK = 0.03  # metres about the wall's plane that count as it
WALL_BIN = 0.01  # metres
WALL_LENGTH = 1.0  # metres of wall that must be seen, in all
WALL_CELL = 0.05  # metres: pieces of wall that are counted for that

TRIPOD_SD, HEADING_SD = 0.3, np.radians(3.0)  # of the survey


@dataclass(frozen=True)
class SandboxFrame:
    """`sandbox_from_level`, and what it rests on."""

    sandbox_from_level: Pose
    walls: int  # inner walls that were found; 0: the survey alone


def find_sandbox_frame(
    points: Mapping[str, np.ndarray],
    normals: Mapping[str, np.ndarray],
    level_from_left: Mapping[str, Pose],
    stations: Mapping[str, Pose],
) -> SandboxFrame:
    """The sandbox frame from scans (n, 3) and their normals (n, 3) in one nearly level frame near it.

    `stations` are `sandbox_from_left` as surveyed, by position; none: origin and heading stay, unless walls tell them.
    """
    all_points = np.concatenate([points[position] for position in sorted(points)])
    all_normals = np.concatenate([normals[position] for position in sorted(points)])
    upright = level_from(_ground(all_points))
    settled = _from_survey({position: upright @ pose for position, pose in level_from_left.items()}, stations) @ upright
    rotated = settled.apply(all_points)
    walls = _walls(rotated, settled.rotate(all_normals))
    if len({wall.axis for wall in walls}) == 2:
        settled = _from_walls(rotated, walls) @ settled
    else:
        walls = []
    # The plane's height is meant at the origin, which has moved since; its slope is nil, so any point will do.
    ground = _ground(settled.apply(all_points))
    down = Pose(np.eye(3), np.array([0, 0, -ground[2]]))
    return SandboxFrame(down @ settled, len(walls))


@dataclass(frozen=True)
class _Wall:
    """An inner wall: along x (axis 0) or y (1), at the low (-1) or high (+1) end, and its points."""

    axis: int
    side: int
    rows: np.ndarray


def _ground(points: np.ndarray) -> np.ndarray:
    """(3,) z = a x + b y + c through the sand."""
    reach = GROUND_SHARE * SANDBOX_HALF_WIDTH
    heights = height_map(points[np.abs(points[:, 2]) < 0.6], reach, GROUND_STEP).height
    row, column = np.nonzero(np.isfinite(heights))
    centres = (np.stack([column, row], axis=1) + 0.5) * GROUND_STEP - reach
    cells = np.column_stack([centres, heights[row, column]])
    return tracked_plane(cells, np.array([0, 0, np.median(cells[:, 2])]), GROUND_SCALES)


def _walls(points: np.ndarray, normals: np.ndarray) -> list[_Wall]:
    """Inner walls of a box that is rotated by at most half a right angle."""
    outer = np.abs(points[:, :2]).max(axis=1)
    likely = (
        (points[:, 2] > WALL_BAND[0])
        & (points[:, 2] < WALL_BAND[1])
        & (np.abs(normals[:, 2]) < WALL_UPRIGHT)
        & (np.abs(outer - SANDBOX_HALF_WIDTH) < WALL_SLACK)
    )
    rows = np.flatnonzero(likely)
    if not len(rows):
        return []
    heading = np.angle(np.exp(4j * np.arctan2(normals[rows, 1], normals[rows, 0])).sum()) / 4
    home = Pose.from_rotvec(np.array([0, 0, -heading]), np.zeros(3))
    upright, facing = home.apply(points[rows]), home.rotate(normals[rows])
    walls = []
    for axis in (0, 1):
        for side in (-1, 1):
            inward = -side * facing[:, axis] > WALL_FACING
            off = side * upright[:, axis] - SANDBOX_HALF_WIDTH
            near = np.flatnonzero(inward & (np.abs(off) < WALL_SLACK))
            kept = near[_peak(off[near])]
            pieces = np.unique(np.floor(upright[kept, 1 - axis] / WALL_CELL))
            if len(pieces) * WALL_CELL >= WALL_LENGTH:
                walls.append(_Wall(axis, side, rows[kept]))
    return walls


def _peak(values: np.ndarray) -> np.ndarray:
    """True for values about the fullest bin."""
    if not len(values):
        return np.zeros(0, bool)
    bins = np.floor(values / WALL_BIN).astype(int)
    count = np.bincount(bins - bins.min())
    smooth = np.convolve(count, np.ones(3), mode="same")
    centre = (smooth.argmax() + bins.min() + 0.5) * WALL_BIN
    return np.abs(values - centre) < WALL_THICK


def _from_walls(points: np.ndarray, walls: list[_Wall]) -> Pose:
    """Pose that lays the walls on their stated lines; opposite walls may both be off by half the box's error."""

    def residuals(unknowns: np.ndarray) -> np.ndarray:
        moved = _flat(unknowns)
        parts = []
        for wall in walls:
            off = moved.apply(points[wall.rows])[:, wall.axis] - wall.side * (
                SANDBOX_HALF_WIDTH + unknowns[3 + wall.axis]
            )
            parts.append(off / np.sqrt(len(off)))  # every wall weighs alike
        # The box's true half widths are free where both ends are seen, and held by this where one is.
        return np.concatenate([*parts, 1e-3 * unknowns[3:]])

    found = least_squares(residuals, np.zeros(5), loss="soft_l1", f_scale=0.01, x_scale=[0.01, 0.1, 0.1, 0.1, 0.1])
    return _flat(found.x)


def _from_survey(level_from_left: Mapping[str, Pose], stations: Mapping[str, Pose]) -> Pose:
    pairs = [
        (level_from_left[position], stations[position]) for position in sorted(set(level_from_left) & set(stations))
    ]
    if not pairs:
        return Pose.identity()

    def residuals(unknowns: np.ndarray) -> np.ndarray:
        moved = _flat(unknowns)
        parts = []
        for pose, surveyed in pairs:
            rotated = moved @ pose
            yaw = yaw_pitch_roll(rotated)[0] - yaw_pitch_roll(surveyed)[0]
            parts += [*((rotated.translation - surveyed.translation)[:2] / TRIPOD_SD)]
            parts += [((yaw + np.pi) % (2 * np.pi) - np.pi) / HEADING_SD]
        return np.array(parts)

    return _flat(least_squares(residuals, np.zeros(3)).x)


def _flat(unknowns: np.ndarray) -> Pose:
    """Rotation about +Z and translation along X and Y."""
    return Pose.from_rotvec(np.array([0, 0, unknowns[0]]), np.array([unknowns[1], unknowns[2], 0.0]))
