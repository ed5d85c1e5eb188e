"""Sandbox frame of aligned scans.

+Z is the normal of a robust plane through all sand, and z = 0 is the height of this plane at the origin. Origin and
heading are computed from the sandbox: its inner walls are at +- its half widths along X and Y. The walls are searched
near their expected places in the frame that best maps the tripods to their surveyed positions and headings. If the
scans do not show two walls at right angles, the frame of the survey is used. A sandbox whose walls are all parallel
takes heading and one coordinate from them, and the other coordinate from the survey; one without walls uses the survey.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from polarsim.cameras.heightmaps import height_map
from polarsim.cameras.search_area import FLOOR_SHOWN
from polarsim.geometry.planes import level_from, tracked_plane
from polarsim.geometry.poses import Pose, yaw_pitch_roll
from polarsim.run_files.walls import SIDES, lowest_wall
from polarsim.site_parts import Sandbox

GROUND_STEP = 0.04  # metres: side of the cells with equal weight in the fit of the ground plane
GROUND_SCALES = [0.3, 0.2, 0.15, 0.1, 0.08, 0.06, 0.05, 0.04, 0.04, 0.04]
GROUND_SHARE = 0.9  # of the half width; sand piles up near the walls

WALL_FOOT = 0.06  # metres above the sand up to which walls are not searched
WALL_SLACK, SLACK_SHARE = 0.6, 0.5  # maximum distance of a wall from its expected place: metres, share of half widths
WALL_UPRIGHT = 0.3  # maximum |z| of the normal of a wall
WALL_FACING = 0.95  # minimum cosine between the normal of a wall and the axis
WALL_THICK = 0.03  # metres from the plane of a wall within which points belong to the wall
WALL_BIN = 0.01  # metres
WALL_LENGTH, LENGTH_SHARE = 1.0, 0.5  # minimum total length of the visible parts of a wall: metres, share of half width
WALL_CELL = 0.05  # metres: size of the pieces of wall that are counted for the length

TRIPOD_SD, HEADING_SD = 0.3, np.radians(3.0)  # standard deviations of the survey, metres and radians


@dataclass(frozen=True)
class SandboxFrame:
    """`sandbox_from_level`, and the number of walls from which it was computed."""

    sandbox_from_level: Pose
    walls: int  # inner walls that were detected; 0: survey only


def find_sandbox_frame(
    points: Mapping[str, np.ndarray],
    normals: Mapping[str, np.ndarray],
    level_from_left: Mapping[str, Pose],
    stations: Mapping[str, Pose],
    sandbox: Sandbox,
) -> SandboxFrame:
    """Compute the sandbox frame from scans (n, 3) and normals (n, 3) in a common, nearly level frame.

    `stations` are the surveyed `sandbox_from_left` by position. Without them, origin and heading change only if walls
    are detected.
    """
    half = np.array(sandbox.half_width_m)
    ground_reach = half + FLOOR_SHOWN if sandbox.raised else GROUND_SHARE * half
    all_points = np.concatenate([points[position] for position in sorted(points)])
    all_normals = np.concatenate([normals[position] for position in sorted(points)])
    upright = level_from(_ground(all_points, ground_reach))
    settled = (
        _pose_from_survey({position: upright @ pose for position, pose in level_from_left.items()}, stations) @ upright
    )
    rotated = settled.apply(all_points)
    walls = _walls(rotated, settled.rotate(all_normals), sandbox)
    expected = {"xy".index(side[1]) for side in SIDES if sandbox.walls_m.get(side)} or {0, 1}
    if {wall.axis for wall in walls} == expected:
        settled = _pose_from_walls(rotated, walls, half) @ settled
    else:
        walls = []
    # The plane's height is defined at the origin, which has moved; the plane is level, so that any point is suitable.
    ground = _ground(settled.apply(all_points), ground_reach)
    down = Pose(np.eye(3), np.array([0, 0, -ground[2]]))
    return SandboxFrame(down @ settled, len(walls))


@dataclass(frozen=True)
class _Wall:
    """Inner wall along x (axis 0) or y (1), at the low (-1) or high (+1) end, and its points."""

    axis: int
    side: int
    rows: np.ndarray


def _ground(points: np.ndarray, reach: np.ndarray) -> np.ndarray:
    """Return (3,) coefficients of the plane z = a x + b y + c through the sand within +-`reach` (2,) of the centre."""
    heights = height_map(points[np.abs(points[:, 2]) < 0.6], reach, GROUND_STEP).height
    row, column = np.nonzero(np.isfinite(heights))
    centres = (np.stack([column, row], axis=1) + 0.5) * GROUND_STEP - reach
    cells = np.column_stack([centres, heights[row, column]])
    return tracked_plane(cells, np.array([0, 0, np.median(cells[:, 2])]), GROUND_SCALES)


def _walls(points: np.ndarray, normals: np.ndarray, sandbox: Sandbox) -> list[_Wall]:
    """Return the inner walls of a box that is rotated by at most 45 degrees."""
    half = np.array(sandbox.half_width_m)
    slack = min(WALL_SLACK, SLACK_SHARE * float(half.min()))
    beyond = (np.abs(points[:, :2]) - half).max(axis=1)
    likely = (
        (points[:, 2] > WALL_FOOT)
        & (points[:, 2] < lowest_wall(sandbox))
        & (np.abs(normals[:, 2]) < WALL_UPRIGHT)
        & (np.abs(beyond) < slack)
    )
    rows = np.flatnonzero(likely)
    if not len(rows):
        return []
    heading = np.angle(np.exp(4j * np.arctan2(normals[rows, 1], normals[rows, 0])).sum()) / 4
    home = Pose.from_rotvec(np.array([0, 0, -heading]), np.zeros(3))
    upright, facing = home.apply(points[rows]), home.rotate(normals[rows])
    walls = []
    for number, name in enumerate(SIDES):
        axis, side = number // 2, (-1, 1)[number % 2]
        if not sandbox.walls_m.get(name):
            continue
        inward = -side * facing[:, axis] > WALL_FACING
        off = side * upright[:, axis] - half[axis]
        near = np.flatnonzero(inward & (np.abs(off) < slack))
        kept = near[_peak(off[near])]
        pieces = np.unique(np.floor(upright[kept, 1 - axis] / WALL_CELL))
        if len(pieces) * WALL_CELL >= min(WALL_LENGTH, LENGTH_SHARE * half[1 - axis]):
            walls.append(_Wall(axis, side, rows[kept]))
    return walls


def _peak(values: np.ndarray) -> np.ndarray:
    """Return a mask of the values near the fullest bin."""
    if not len(values):
        return np.zeros(0, bool)
    bins = np.floor(values / WALL_BIN).astype(int)
    count = np.bincount(bins - bins.min())
    smooth = np.convolve(count, np.ones(3), mode="same")
    centre = (smooth.argmax() + bins.min() + 0.5) * WALL_BIN
    return np.abs(values - centre) < WALL_THICK


def _pose_from_walls(points: np.ndarray, walls: list[_Wall], half: np.ndarray) -> Pose:
    """Fit the pose that maps the walls to their nominal lines; deviations from the half widths (2,) are unknowns.

    A coordinate without a wall does not change.
    """

    def residuals(unknowns: np.ndarray) -> np.ndarray:
        moved = _flat(unknowns)
        parts = []
        for wall in walls:
            off = moved.apply(points[wall.rows])[:, wall.axis] - wall.side * (half[wall.axis] + unknowns[3 + wall.axis])
            parts.append(off / np.sqrt(len(off)))  # equal weight for every wall
        # The half widths are free if both opposite walls are visible; otherwise this term fixes them.
        return np.concatenate([*parts, 1e-3 * unknowns[3:]])

    fit = least_squares(residuals, np.zeros(5), loss="soft_l1", f_scale=0.01, x_scale=[0.01, 0.1, 0.1, 0.1, 0.1])
    return _flat(fit.x)


def _pose_from_survey(level_from_left: Mapping[str, Pose], stations: Mapping[str, Pose]) -> Pose:
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
    """Return a rotation about +Z and a translation along X and Y."""
    return Pose.from_rotvec(np.array([0, 0, unknowns[0]]), np.array([unknowns[1], unknowns[2], 0.0]))
