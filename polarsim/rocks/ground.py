"""Ground and heights above it: the box of sand, the sand's surface, and separation of sand and rock by slope."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from polarsim.rocks.heights import FloorGrid, filled, hull_mask, mean_heights, smoothed, top_heights
from polarsim.rocks.scans import Extent, ScanPoints, wall_foot
from polarsim.run_files.walls import SIDES
from polarsim.site_parts import Sandbox

MAX_SAND_SLOPE = np.tan(np.radians(40))  # steeper surfaces are rock; loose sand rests at up to 38 degrees
GROUND_CELL = 0.005  # cell of the grid of scanned heights, metres
EXCLUDED_WALL_MARGIN = 0.03  # width of the excluded sand along a wall, metres
MAX_WALL_OFFSET = 0.4  # maximum distance of a wall from its nominal line, metres
LEVEL_TOLERANCE = 0.010  # maximum height of an area of ground within steep edges above its surroundings, metres
_SQUARE = np.ones((3, 3), bool)
OUTLINE_SLOPE_SHARE = 0.65  # minimum slope of an edge that outlines a low rock, share of the sand's maximum slope
OUTLINE_SIDES = (0.025, 0.60)  # metres: shorter steep edges are pebbles, longer edges do not outline a single rock
RAISED_SHARE = 0.15  # minimum share of an outlined area above the level tolerance
FOOT_MARGIN = 2  # cells around rocks that are excluded from the heights of the ground


@dataclass(frozen=True)
class SandSurface:
    """Surface of the sand on a grid; arrays are (rows, columns)."""

    grid: FloorGrid
    surface: np.ndarray  # heights of the scanned surface, rocks included, smoothed; NaN in hidden cells
    mean: np.ndarray  # mean heights of the points of each cell; NaN in cells without points
    top: np.ndarray  # heights of the surface without points under overhangs
    ground: np.ndarray  # heights of the ground in all cells
    is_ground: np.ndarray  # visible cells that are ground

    @property
    def above(self) -> np.ndarray:
        """Heights of the surface above the ground; 0 in hidden cells."""
        return np.nan_to_num(self.surface - self.ground)

    @property
    def top_above(self) -> np.ndarray:
        """Heights of the top above the ground; 0 in hidden cells."""
        return np.nan_to_num(self.top - self.ground)

    @property
    def standing(self) -> np.ndarray:
        """Heights above the ground that do not depend on smoothing: means of the points of each cell if it has any."""
        return np.nan_to_num(np.fmin(self.mean, self.surface) - self.ground)


def sand_extent(scans: ScanPoints, sandbox: Sandbox, cell: float = 0.02) -> Extent:
    """Return the rectangle of sand between the walls: where the surface rises by a wall's height, else the nominal one.

    On each side, points higher than a wall above the median height of the sand are collected in strips. The wall is at
    the median over strips of their minimum distance from the centre. Sides without a wall are nominal; a raised sandbox
    has a rim of unknown height.
    """
    half = np.array(sandbox.half_width_m)
    area = scans.points[(np.abs(scans.points[:, :2]) < half + MAX_WALL_OFFSET).all(axis=1)]
    if not len(area):
        return Extent(*-half, *half)
    central = (np.abs(area[:, :2]) < half / 2).all(axis=1)
    level = np.median(area[central, 2]) if central.any() else np.median(area[:, 2])
    high = area[area[:, 2] > level + wall_foot(sandbox)]
    sides = {}
    for axis in (0, 1):
        for sign in (-1, 1):
            found = float(half[axis])
            if sandbox.raised or sandbox.walls_m.get(SIDES[2 * axis + (sign > 0)]):
                found = _wall_distance(sign * high[:, axis], high[:, 1 - axis], found, float(half[1 - axis]), cell)
            sides[axis, sign] = sign * found
    return Extent(sides[0, -1], sides[1, -1], sides[0, 1], sides[1, 1]).grown(-EXCLUDED_WALL_MARGIN)


def _wall_distance(outward: np.ndarray, along: np.ndarray, half: float, length: float, cell: float) -> float:
    """Return the distance of a wall from the origin, from outward and along coordinates (n,) of its high points.

    `half`: nominal distance, `length`: half the length of the wall, metres.
    """
    beyond = (outward > half - MAX_WALL_OFFSET) & (np.abs(along) < length)
    strip = np.round(along[beyond] / cell).astype(int)
    if not len(strip):
        return half
    order = np.lexsort((outward[beyond], strip))
    first = np.unique(strip[order], return_index=True)[1]
    if len(first) < 0.3 * 2 * length / cell:  # a wall is visible along much of its side
        return half
    return float(np.median(outward[beyond][order][first]))


def find_ground(scans: ScanPoints, extent: Extent, cell: float) -> SandSurface:
    """Separate sand and rock by slope: loose sand is not steeper than its angle of repose, flanks of rocks are.

    Cells of gentle slope form areas; the largest is ground. Other areas are ground unless they are higher than their
    surroundings (a rock's top). Therefore craters, mounds and pits of any size are ground.

    `cell`: side of a grid cell, metres.
    """
    grid = FloorGrid(extent.snapped(cell), cell)
    mean, weights = mean_heights(grid, scans.points, scans.weights)
    surface = smoothed(mean, weights, 1.0)
    seen = ndimage.binary_closing(weights > 0, _SQUARE, border_value=0) & np.isfinite(surface)
    surface = np.where(seen, surface, np.nan)
    slope = _slope(filled(np.nan_to_num(surface), seen), cell)
    is_ground = _level_areas(surface, seen & (slope < MAX_SAND_SLOPE))
    is_ground = _without_outlined(surface, seen & (slope > OUTLINE_SLOPE_SHARE * MAX_SAND_SLOPE), is_ground, cell)
    ground = filled(np.nan_to_num(surface), is_ground)
    top = np.where(seen, smoothed(*top_heights(grid, scans.points, scans.weights), 1.0), np.nan)
    return SandSurface(grid, surface, mean, top, ground, is_ground)


def _slope(heights: np.ndarray, cell: float) -> np.ndarray:
    """Return the tangent of the slope, from differences over two cells."""
    along_y, along_x = np.gradient(heights, cell)
    return np.hypot(along_y, along_x)


def _level_areas(surface: np.ndarray, gentle: np.ndarray) -> np.ndarray:
    """Return the gentle cells that are ground, without a margin at the foot of other objects."""
    core = ndimage.binary_erosion(gentle, _SQUARE)  # cuts narrow connections that noise creates along a flank
    areas, count = ndimage.label(core)
    if not count:
        return np.zeros_like(gentle)
    sizes = np.bincount(areas.ravel(), minlength=count + 1)
    sizes[0] = 0
    main = areas == np.argmax(sizes)
    above = surface - filled(np.nan_to_num(surface), main)
    height = ndimage.median(np.nan_to_num(above), areas, np.arange(1, count + 1))
    level = np.concatenate([[False], np.asarray(height) < LEVEL_TOLERANCE])
    near_rock = ndimage.binary_dilation(np.isfinite(surface) & ~gentle, iterations=FOOT_MARGIN)
    return level[areas] & ~near_rock


def _without_outlined(surface: np.ndarray, steep: np.ndarray, is_ground: np.ndarray, cell: float) -> np.ndarray:
    """Exclude rocks with a gentle side from the ground.

    Connected steep edges outline a rock if the area within their hull is raised. Long edges are walls of craters and
    tracks.
    """
    edges, _ = ndimage.label(ndimage.binary_dilation(steep, _SQUARE), _SQUARE)
    outlined = np.zeros_like(edges)
    for number, box in enumerate(ndimage.find_objects(edges), 1):
        sides = [(part.stop - part.start) * cell for part in box]
        if OUTLINE_SIDES[0] < max(sides) < OUTLINE_SIDES[1]:
            outlined[box][hull_mask(edges[box] == number)] = number
    level = filled(np.nan_to_num(surface), is_ground & (outlined == 0))
    seen = np.isfinite(surface)
    raised = np.bincount(outlined[seen & (surface > level + LEVEL_TOLERANCE)], minlength=outlined.max() + 1)
    is_raised = raised > RAISED_SHARE * np.bincount(outlined[seen], minlength=outlined.max() + 1)
    is_raised[0] = False
    return is_ground & ~ndimage.binary_dilation(is_raised[outlined], iterations=FOOT_MARGIN)
