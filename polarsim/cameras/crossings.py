"""Points of the ground that two positions measure: windows of orthophotos under the same lamps, matched in plan."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from polarsim.cameras.disparities import FLOOR, RangePoints
from polarsim.cameras.self_calibration import Crossing, StereoPixels
from polarsim.geometry.contrast import local_contrast
from polarsim.geometry.poses import Pose
from polarsim.geometry.stereo import StereoRig

SPACING_CELL = 0.04  # metres: grid on which the spacing of points is averaged
MARGIN = 0.1  # width of the orthophotos beyond the border of the sand, metres
CONTRAST_CELLS = 4.0  # standard deviation of the window of local contrast
HALF_WINDOW, STEP_CELLS = 10, 5  # half size of a matched window, and distance of neighbouring windows, cells
MIN_CORRELATION = 0.45
MIN_KNOWN = 0.6  # minimum share of a window that is known


@dataclass(frozen=True)
class Ortho:
    """Maps of a position in the level frame, (rows along y, columns along x)."""

    height: np.ndarray  # metres, NaN in empty cells
    patterns: np.ndarray  # (rows, columns, lamps) float32
    reach: np.ndarray  # (2,) half widths along x and y, metres


def point_spacing(seen: RangePoints, level_from_left: Pose, half: np.ndarray) -> np.ndarray:
    """Return the mean distance in plan between points of neighbouring rows, in the cells of a map, metres.

    Rows are farther apart on the ground than columns. NaN in cells without points; `half` as in `orthophotos`.
    """
    points = level_from_left.apply(seen.points_left)[..., :2]
    spacing = np.linalg.norm(points[1:] - points[:-1], axis=-1)
    columns, rows = np.ceil(2 * half / SPACING_CELL).astype(int)
    known = np.isfinite(spacing) & (np.abs(points[1:]) < half).all(axis=-1)
    column, row = np.floor((points[1:][known] + half) / SPACING_CELL).astype(int).T
    number = row * columns + column
    count = np.bincount(number, minlength=rows * columns)
    total = np.bincount(number, spacing[known], rows * columns)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan).reshape(rows, columns)


def common_spacing(fixed: np.ndarray, moving: np.ndarray) -> float | None:
    """Return the median of the larger spacing where both maps of `point_spacing` have points; None without such cells.

    With cells of this size, half of the common ground has points of both positions in every cell.
    """
    larger = np.maximum(fixed, moving)
    return float(np.nanmedian(larger)) if np.isfinite(larger).any() else None


def orthophotos(seen: RangePoints, level_from_left: Pose, cell: float, half: np.ndarray) -> Ortho:
    """Average heights and photos in the cells of a map; `half` (2,): half widths of the sand, metres."""
    known = np.isfinite(seen.points_left[..., 2])
    points = level_from_left.apply(seen.points_left[known])
    reach = half + MARGIN
    columns, rows = (2 * round(float(along) / cell) for along in reach)
    column, row = np.floor((points[:, :2] + reach) / cell).astype(int).T
    inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows) & (np.abs(points[:, 2]) < 0.6)
    number = (row * columns + column)[inside]
    count = np.bincount(number, minlength=rows * columns)

    def mean(values: np.ndarray) -> np.ndarray:
        total = np.bincount(number, values[inside], rows * columns)
        return np.where(count > 0, total / np.maximum(count, 1), np.nan).reshape(rows, columns)

    patterns = [local_contrast(mean(logs[known]).astype(np.float32), CONTRAST_CELLS, FLOOR) for logs in seen.logs]
    return Ortho(mean(points[:, 2]), np.stack(patterns, axis=-1), reach)


def match_orthophotos(fixed: Ortho, moving: Ortho, cell: float, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the same points (n, 3) in both maps, level frame, metres.

    `reach`: maximum displacement in plan, metres.
    """
    import cv2

    search = round(reach / cell)
    border = HALF_WINDOW + search
    rows, columns = fixed.height.shape
    shown = np.isfinite(fixed.height)
    share = cv2.blur(shown.astype(np.float32), (2 * HALF_WINDOW + 1,) * 2)
    firsts, seconds = [], []
    lattice = [(row, column) for row in range(border, rows - border, STEP_CELLS)
               for column in range(border, columns - border, STEP_CELLS) if share[row, column] > MIN_KNOWN]  # fmt: skip
    for row, column in lattice:
        area = _window(moving.patterns, row, column, border)
        if not area.any():
            continue
        likeness = cv2.matchTemplate(area, _window(fixed.patterns, row, column, HALF_WINDOW), cv2.TM_CCORR_NORMED)
        down, across = divmod(int(likeness.argmax()), likeness.shape[1])
        if likeness[down, across] < MIN_CORRELATION or not (0 < down < 2 * search and 0 < across < 2 * search):
            continue
        right, up = _peak(likeness[down - 1 : down + 2, across - 1 : across + 2])
        z = _height(fixed.height, row, column), _height(moving.height, row + down - search, column + across - search)
        if np.isfinite(z).all():
            x, y = (column + 0.5) * cell - float(fixed.reach[0]), (row + 0.5) * cell - float(fixed.reach[1])
            firsts.append((x, y, z[0]))
            seconds.append((x + (across - search + right) * cell, y + (down - search + up) * cell, z[1]))
    return np.array(firsts).reshape(-1, 3), np.array(seconds).reshape(-1, 3)


def _window(values: np.ndarray, row: int, column: int, half: int) -> np.ndarray:
    return values[row - half : row + half + 1, column - half : column + half + 1]


def _height(height: np.ndarray, row: int, column: int) -> float:
    around = _window(height, row, column, 2)
    return float(np.nanmedian(around)) if np.isfinite(around).sum() > 12 else float("nan")


def _peak(around: np.ndarray) -> tuple[float, float]:
    """Return the offset of the peak of a parabola through (3, 3) values from their centre, along columns and rows."""

    def offset(left: float, middle: float, right: float) -> float:
        bend = left + right - 2 * middle
        return float(np.clip((left - right) / (2 * bend), -0.5, 0.5)) if bend < 0 else 0.0

    return offset(*around[1].tolist()), offset(*around[:, 1].tolist())


def find_crossing(
    seen: Mapping[str, RangePoints],
    pair: tuple[str, str],
    rig: StereoRig,
    poses: Mapping[str, Pose],
    reach: float,
    half: np.ndarray,
) -> Crossing:
    """Match the ground that two positions measure; return its pixels in all four photos.

    `poses`: `level_from_left` by position. `reach`, `half` (2,): of `match_orthophotos` and `orthophotos`, metres.
    """
    cell = common_spacing(*(point_spacing(seen[name], poses[name], half) for name in pair))
    if cell is None:
        nothing = StereoPixels(np.empty((0, 2)), np.empty((0, 2)))
        return Crossing(nothing, nothing)
    fixed, moving = (orthophotos(seen[name], poses[name], cell, half) for name in pair)
    points = match_orthophotos(fixed, moving, cell, reach)
    return Crossing(*(_pixels(rig, poses[name].inverse().apply(part)) for name, part in zip(pair, points, strict=True)))


def _pixels(rig: StereoRig, points_left: np.ndarray) -> StereoPixels:
    right = rig.right.project(rig.left_from_right.inverse().apply(points_left))
    return StereoPixels(rig.left.project(points_left), right)
