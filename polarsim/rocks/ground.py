"""Ground and what stands on it: the box of sand, the sand's surface, and heights above it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from polarsim.rocks.heights import FloorGrid, filled, hull_mask, mean_heights, smoothed, top_heights
from polarsim.rocks.scans import LEAST_WALL_HEIGHT, Extent, ScanPoints
from polarsim.survey import SANDBOX_HALF_WIDTH

GROUND_CELL = 0.005  # metres: cell of the grid on which heights are taken from scans
WALL_MARGIN = 0.03  # metres of sand along a wall that are left out: the wall's foot is not sand
WALL_SLACK = 0.4  # metres by which a wall can stand off its stated line
LEVEL_TOLERANCE = 0.010  # metres above its surroundings up to which an area within steep edges still is ground
_SQUARE = np.ones((3, 3), bool)
EDGE_SHARE = 0.65  # of the steepest sand's slope: from there on an edge can outline a low rock
OUTLINE_SIDES = (0.025, 0.60)  # metres: shorter steep edges are pebbles, longer ones are no single rock's
RAISED_SHARE = 0.15  # of an outlined area that must lie above the level tolerance: flanks and foot need not
FOOT_MARGIN = 2  # cells around rock that do not tell the ground's height


@dataclass(frozen=True)
class Sand:
    """The sand's surface on a grid; arrays are (rows, columns)."""

    grid: FloorGrid
    surface: np.ndarray  # heights of the scanned surface, rocks included, smoothed; NaN where nothing was seen
    mean: np.ndarray  # the same as each cell's own points have it; NaN in cells without any
    top: np.ndarray  # the surface again, without what scans saw under an overhang
    ground: np.ndarray  # heights of the ground, everywhere
    is_ground: np.ndarray  # cells whose surface was seen and is ground

    @property
    def above(self) -> np.ndarray:
        """Heights of the surface above the ground; 0 where nothing was seen."""
        return np.nan_to_num(self.surface - self.ground)

    @property
    def top_above(self) -> np.ndarray:
        """Heights of the top above the ground; 0 where nothing was seen."""
        return np.nan_to_num(self.top - self.ground)

    @property
    def standing(self) -> np.ndarray:
        """Heights above the ground that no neighbour lends: those of each cell's own points where it has some."""
        return np.nan_to_num(np.fmin(self.mean, self.surface) - self.ground)


def sand_extent(scans: ScanPoints, half: float = SANDBOX_HALF_WIDTH, cell: float = 0.02) -> Extent:
    """The rectangle of sand between the walls: where the surface rises by a wall's height, else as stated.

    On each side the wall stands at the median over strips of the first distance from the centre at which points lie
    high above the sand's median height. `half`: stated half width of the sand, metres.
    """
    area = scans.points[(np.abs(scans.points[:, :2]) < half + WALL_SLACK).all(axis=1)]
    if not len(area):
        return Extent(-half, -half, half, half)
    central = (np.abs(area[:, :2]) < half / 2).all(axis=1)
    level = np.median(area[central, 2]) if central.any() else np.median(area[:, 2])
    high = area[area[:, 2] > level + LEAST_WALL_HEIGHT]
    sides = {}
    for axis in (0, 1):
        for sign in (-1, 1):
            sides[axis, sign] = sign * _wall_distance(sign * high[:, axis], high[:, 1 - axis], half, cell)
    return Extent(sides[0, -1], sides[1, -1], sides[0, 1], sides[1, 1]).grown(-WALL_MARGIN)


def _wall_distance(outward: np.ndarray, along: np.ndarray, half: float, cell: float) -> float:
    """Distance of a wall from the origin, from its high points: outward and along coordinates (n,)."""
    beyond = (outward > half - WALL_SLACK) & (np.abs(along) < half)
    strip = np.round(along[beyond] / cell).astype(int)
    if not len(strip):
        return half
    order = np.lexsort((outward[beyond], strip))
    first = np.unique(strip[order], return_index=True)[1]
    if len(first) < 0.3 * 2 * half / cell:  # a wall is seen along much of its side
        return half
    return float(np.median(outward[beyond][order][first]))


def find_ground(scans: ScanPoints, extent: Extent, cell: float, max_slope: float) -> Sand:
    """Tell sand from rock by slope: loose sand cannot be steeper than its angle of repose, a rock's flanks are.

    Cells of gentle slope make areas; the largest is ground, others are ground unless they lie above their
    surroundings (a rock's top). So craters, mounds and pits stay ground whatever their size.

    Parameters
    ----------
    cell : float
        Side of a grid cell, metres.
    max_slope : float
        Steepest slope of sand, radians.
    """
    grid = FloorGrid(extent.snapped(cell), cell)
    mean, weights = mean_heights(grid, scans.points, scans.weights)
    surface = smoothed(mean, weights, 1.0)
    seen = ndimage.binary_closing(weights > 0, _SQUARE, border_value=0) & np.isfinite(surface)
    surface = np.where(seen, surface, np.nan)
    slope = _slope(filled(np.nan_to_num(surface), seen), cell)
    is_ground = _level_areas(surface, seen & (slope < np.tan(max_slope)))
    is_ground = _without_outlined(surface, seen & (slope > EDGE_SHARE * np.tan(max_slope)), is_ground, cell)
    ground = filled(np.nan_to_num(surface), is_ground)
    top = np.where(seen, smoothed(*top_heights(grid, scans.points, scans.weights), 1.0), np.nan)
    return Sand(grid, surface, mean, top, ground, is_ground)


def _slope(heights: np.ndarray, cell: float) -> np.ndarray:
    """Tangent of the slope, from differences over two cells."""
    along_y, along_x = np.gradient(heights, cell)
    return np.hypot(along_y, along_x)


def _level_areas(surface: np.ndarray, gentle: np.ndarray) -> np.ndarray:
    """Gentle cells that are ground, without a margin at the foot of what is not."""
    core = ndimage.binary_erosion(gentle, _SQUARE)  # cuts bridges that noise builds up a flank
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
    """Ground without rocks that have a gentle side, up which the ground's area grew.

    Steep edges that hang together outline a rock where the area within their hull is raised. Long edges are crater
    walls and tracks.
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
