"""Map updates from boxes, depths or instance ids of pixels at a time."""

from __future__ import annotations

import math

import numpy as np
from scipy import ndimage

from polarsim.geometry.camera import Camera
from polarsim.photo import BLACK_LEVEL
from polarsim.rover.perception.ground_view import HeightFunction, part_centres, rocks_on_ground, view_ground
from polarsim.rover.perception.hazard_grid import PARTS, HazardGrid, MapUpdate, of_parts

FARTHEST_M = 5.0  # maximum distance of mapped ground from the camera
_FULL_WEIGHT_M = 2.0  # updates at larger distances have a weight with the inverse square of the distance
_STEREO_ROCK_M = 0.05  # minimum height of a stereo rock above the surrounding ground
_ABOUT_PX = 9  # window for averaging light, which reduces the noise of single pixels
_LEAST_SHARE = 0.5  # minimum share of a cell's points in the picture
_MOST_SURE = 0.95  # maximum probability of a rock after a single detection
_POINTS = 12  # minimum number of depths in a cell
_TOP_PERCENT, _FOOT_PERCENT = 90, 25
_AROUND = 9  # cells; side of the median filter for the surrounding ground
_ROCK_SHARE = 0.5  # minimum share of a part's pixels that are rock
SURE = 1.0  # confidence of labels
_STEREO_SURE = 0.4  # confidence of stereo: a rock changes a cell about as much as free ground


def update_from_boxes(
    boxes: np.ndarray, confidence: np.ndarray, lit: np.ndarray, camera: Camera, ground: HeightFunction, grid: HazardGrid
) -> MapUpdate:
    """Return the update of boxes of rocks (n, 4) with confidences (n,); lit ground in view without a box is free.

    A rock is the upper half of an ellipsoid over the footprint of a box. A cell is rock if a rock covers a part of it.
    Pixels that are not `lit`, (h, w) bool, are ignored outside boxes, since detectors find no rocks in the dark.
    """
    x, y = (part_centres(values, grid.cell_m, PARTS) for values in (grid.x, grid.y))
    view = view_ground(x, y, camera, ground, np.asarray(boxes, float).reshape(-1, 4), (0.0, FARTHEST_M))
    pixel, distance, inside, confidence = view.pixel, view.distance, view.inside, confidence[view.whole]
    height, odds, rise = (np.zeros(inside.shape) for _ in range(3))
    for number, covered, rock_rise in rocks_on_ground(view.rocks, view.points[..., 0], view.points[..., 1]):
        full_height = np.where(covered, view.rocks.height[number], 0.0)  # a hazard has the height of the entire rock
        odds = np.where(full_height > height, _log_odds(float(confidence[number])), odds)
        height = np.maximum(height, full_height)
        rise = np.maximum(rise, rock_rise)
    column, row = np.moveaxis(np.where(inside[..., None], pixel, 0).astype(int), -1, 0)
    counted = inside & (lit[row, column] | (odds > 0))
    surface = np.where(counted, view.points[..., 2] + rise, np.nan)
    full = [np.zeros(grid.surface.shape) for _ in range(5)] + [np.full(grid.surface.shape, np.nan)]
    for into, values in zip(
        full, (inside, counted, np.where(inside, height, 0), np.where(inside, odds, 0), distance, surface), strict=True
    ):
        into[view.window] = values
    in_view, share, top, sure, far = (
        of_parts(values, how) for values, how in zip(full[:5], ("mean", "mean", "max", "max", "max"), strict=True)
    )
    known = np.where(sure > 0, in_view, share) >= _LEAST_SHARE
    return MapUpdate(np.where(known, _weight(far), 0.0), sure, np.where(sure > 0, top, np.nan), full[5])


def bright_pixels(grey: np.ndarray, minimum: float) -> np.ndarray:
    """Return (h, w) bool: pixels of a 12-bit picture with a local mean of at least `minimum` above the black level."""
    above = grey.astype(np.float32) - BLACK_LEVEL
    return np.asarray(ndimage.uniform_filter(above, _ABOUT_PX) >= minimum)


def update_from_pixels(
    points: np.ndarray, rock: np.ndarray, above: np.ndarray, camera: Camera, grid: HazardGrid
) -> MapUpdate:
    """Return the update of pixels: points (n, 3) of the world, their rock numbers (n,), 0 for ground.

    `above`: (n,) heights of points on rocks above the ground, m.

    A part of a cell is rock if at least half of the pixels near the centre of the part are rock, or half of all pixels
    of the part if none is near the centre, since the steep side of a rock has many pixels. A cell is rock if a part is
    rock. The height of a rock is that of the highest pixel above the ground.
    """
    shape, size = grid.surface.shape, grid.surface.size
    part = _numbers(points, camera, grid, PARTS)
    points, rock, above, part = points[part >= 0], rock[part >= 0], above[part >= 0], part[part >= 0]
    shares = []
    for chosen in (np.ones(len(part), bool), _central(points, grid)):
        pixels, rocky = (np.bincount(part[mask], minlength=size) for mask in (chosen, chosen & (rock > 0)))
        shares.append(np.divide(rocky, pixels, out=np.full(size, np.nan), where=pixels > 0))
    is_rock = np.where(np.isfinite(shares[1]), shares[1], np.nan_to_num(shares[0])) >= _ROCK_SHARE
    mean = _mean_height(points, part, size)
    top = np.full(size, -np.inf)
    np.maximum.at(top, part, points[:, 2])
    surface = np.where(is_rock, top, mean)  # the steep side of a rock has more pixels than the top
    heights = np.zeros(int(rock.max(initial=0)) + 1)
    on_rock = rock > 0
    np.maximum.at(heights, rock[on_rock], above[on_rock])
    height = np.zeros(size)
    np.maximum.at(height, part[on_rock], heights[rock[on_rock]])
    share = of_parts(np.isfinite(mean).reshape(shape), "mean")
    has_rock = of_parts(is_rock.reshape(shape), "any")
    weight = np.where(share > 0, _weight_of_cells(camera, grid), 0.0)
    weight *= np.where(has_rock, 1.0, share)  # unobserved parts of a cell may be rock
    tall = of_parts(np.where(is_rock, height, 0.0).reshape(shape), "max")
    return MapUpdate(
        weight, np.where(has_rock, _log_odds(SURE), 0.0), np.where(has_rock, tall, np.nan), surface.reshape(shape)
    )


def update_from_depth(points: np.ndarray, camera: Camera, grid: HazardGrid) -> MapUpdate:
    """Return the update of stereo points (n, 3) of the world: cells above the surrounding ground are rock."""
    shape = len(grid.y), len(grid.x)
    points = points[np.isfinite(points).all(axis=1)]
    cell = _numbers(points, camera, grid)
    points, cell = points[cell >= 0], cell[cell >= 0]
    z = points[:, 2]
    order = np.lexsort((z, cell))
    cell, z = cell[order], z[order]
    numbers, first, count = np.unique(cell, return_index=True, return_counts=True)
    known = count >= _POINTS
    numbers, first, count = numbers[known], first[known], count[known]
    top, foot = (np.full(shape, np.nan) for _ in range(2))
    for into, percent in ((top, _TOP_PERCENT), (foot, _FOOT_PERCENT)):
        into.ravel()[numbers] = z[first + (count - 1) * percent // 100]
    observed = np.isfinite(foot)
    if not observed.any():
        return MapUpdate(np.zeros(shape), np.zeros(shape), top, np.full(grid.surface.shape, np.nan))
    nearest = ndimage.distance_transform_edt(~observed, return_distances=False, return_indices=True)
    around = ndimage.median_filter(foot[tuple(nearest)], _AROUND)
    height = np.where(observed, top - around, np.nan)
    rock = observed & (np.nan_to_num(height) > _STEREO_ROCK_M)
    weight = np.where(observed, _weight_of_cells(camera, grid), 0.0)
    surface = _mean_height(points, _numbers(points, camera, grid, PARTS), grid.surface.size)
    odds = np.where(rock, _log_odds(_STEREO_SURE), 0.0)
    return MapUpdate(weight, odds, np.where(rock, height, np.nan), surface.reshape(grid.surface.shape))


def _mean_height(points: np.ndarray, part: np.ndarray, size: int) -> np.ndarray:
    """Return (size,) mean heights of points (n, 3) by their parts (n,) of cells; NaN without a point."""
    count, total = np.bincount(part, minlength=size), np.bincount(part, points[:, 2], size)
    return np.divide(total, count, out=np.full(size, np.nan), where=count > 0)


def _central(points: np.ndarray, grid: HazardGrid) -> np.ndarray:
    """Return (n,) bool: points (n, 3) closer to the centre of their part of a cell than to its edge."""
    central = np.ones(len(points), bool)
    for axis, centres in ((0, grid.x), (1, grid.y)):
        part = ((points[:, axis] - centres[0]) / grid.cell_m + 0.5) * PARTS
        central &= np.abs(part - np.floor(part) - 0.5) < 0.25
    return central


def _numbers(points: np.ndarray, camera: Camera, grid: HazardGrid, parts: int = 1) -> np.ndarray:
    """Return (n,) flat indices of the cells, or parts of cells, of points (n, 3); -1 outside the grid or too far."""
    shape = parts * len(grid.y), parts * len(grid.x)
    column, row = (
        np.floor(((points[:, axis] - centres[0]) / grid.cell_m + 0.5) * parts).astype(int)
        for axis, centres in ((0, grid.x), (1, grid.y))
    )
    inside = (column >= 0) & (column < shape[1]) & (row >= 0) & (row < shape[0])
    inside &= np.hypot(*(points[:, :2] - camera.centre[:2]).T) <= FARTHEST_M
    return np.where(inside, row * shape[1] + column, -1)


def _log_odds(confidence: float) -> float:
    """Return the log-odds of a rock after a detection: 0 at confidence 0, bounded at confidence 1."""
    sure = min(0.5 + 0.5 * confidence, _MOST_SURE)
    return math.log(sure / (1 - sure))


def _weight(distance: np.ndarray) -> np.ndarray:
    return np.asarray(np.minimum(1.0, (_FULL_WEIGHT_M / np.maximum(distance, 1e-6)) ** 2))


def _weight_of_cells(camera: Camera, grid: HazardGrid) -> np.ndarray:
    return _weight(np.hypot(*np.meshgrid(grid.x - camera.centre[0], grid.y - camera.centre[1])))
