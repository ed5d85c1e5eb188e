"""From what the cameras give, boxes or depths, to what one look says of the map's cells."""

from __future__ import annotations

import math

import numpy as np
from scipy import ndimage

from polarsim.geometry.camera import Camera
from polarsim.rover.autonomy.hazard_grid import HazardGrid, Look
from polarsim.rover.autonomy.options import MapOptions
from polarsim.rover.onboard.ground_view import Heights, estimate

_PARTS = 5  # points along a side of a cell
_RIM_PX = 2.0  # boxes so near to the picture's rim are cut: what they show is not known
_LEAST_SHARE = 0.5  # of a cell's points that must be in the picture
_MOST_SURE = 0.95  # confidence of a detection that counts no more than this
_POINTS = 12  # of depth in a cell, which say something of it
_TOP_PERCENT, _FOOT_PERCENT = 90, 25
_AROUND = 9  # cells whose median is the ground around
SURE = 1.0  # confidence of labels
_STEREO_SURE = 0.4  # of stereo: a look that shows a rock counts about as much as one that shows none


def look_of_boxes(boxes: np.ndarray, confidence: np.ndarray, camera: Camera, ground: Heights, grid: HazardGrid) -> Look:
    """From rocks' boxes (n, 4) in a picture and their confidences (n,); ground in view without one is no rock.

    A cell shows rock where a rock, the upper half of an ellipsoid over the box's foot, covers any of its points.
    """
    options = grid.options
    x, y = (_parts(values, options.cell_m) for values in (grid.x, grid.y))
    columns, rows = (_near(values, float(eye), options) for values, eye in zip((x, y), camera.centre[:2], strict=True))
    gx, gy = np.meshgrid(x[columns], y[rows])
    points = np.stack([gx, gy, ground(gx, gy)], axis=-1)
    pixel = camera.project(points)
    distance = np.linalg.norm((points - camera.centre)[..., :2], axis=-1)
    inside = camera.inside(pixel) & (distance <= options.farthest_m)
    boxes = np.asarray(boxes, float).reshape(-1, 4)
    cut = (boxes[:, :2] < _RIM_PX).any(axis=1) | (boxes[:, 2:] > camera.size - _RIM_PX).any(axis=1)
    for box in boxes[cut]:
        inside &= ~((pixel > box[:2]) & (pixel < box[2:])).all(axis=-1)
    rocks = estimate(boxes[~cut], camera, ground)
    height, odds = np.zeros(gx.shape), np.zeros(gx.shape)
    for centre, width, high, sure in zip(rocks.centre, rocks.width, rocks.height, confidence[~cut], strict=True):
        if not (np.isfinite(centre).all() and width > 0):
            continue
        squared = ((gx - centre[0]) ** 2 + (gy - centre[1]) ** 2) / (width / 2) ** 2
        own = np.where(squared < 1, high, 0.0)  # a hazard is as high as the rock that it is a part of
        odds = np.where(own > height, _log_odds(float(sure)), odds)
        height = np.maximum(height, own)
    shape = len(grid.y), len(grid.x)
    full = [np.zeros((shape[0] * _PARTS, shape[1] * _PARTS)) for _ in range(4)]
    for into, values in zip(
        full, (inside, np.where(inside, height, 0), np.where(inside, odds, 0), distance), strict=True
    ):
        into[rows, columns] = values
    share, top, sure, far = (
        _cells(values, how) for values, how in zip(full, ("mean", "max", "max", "max"), strict=True)
    )
    weight = np.where(share >= _LEAST_SHARE, _weight(far, options), 0.0)
    return Look(weight, sure, np.where(sure > 0, top, np.nan), np.full(shape, np.nan))


def look_of_depth(points: np.ndarray, camera: Camera, grid: HazardGrid) -> Look:
    """From points (n, 3) of the world that stereo sees: cells that stand above the ground around are rock."""
    options, shape = grid.options, (len(grid.y), len(grid.x))
    points = points[np.isfinite(points).all(axis=1)]
    distance = np.hypot(*(points[:, :2] - camera.centre[:2]).T)
    column = np.floor((points[:, 0] - grid.x[0]) / options.cell_m + 0.5).astype(int)
    row = np.floor((points[:, 1] - grid.y[0]) / options.cell_m + 0.5).astype(int)
    kept = (distance <= options.farthest_m) & (column >= 0) & (column < shape[1]) & (row >= 0) & (row < shape[0])
    cell, z = (row * shape[1] + column)[kept], points[kept, 2]
    order = np.lexsort((z, cell))
    cell, z = cell[order], z[order]
    numbers, first, count = np.unique(cell, return_index=True, return_counts=True)
    known = count >= _POINTS
    numbers, first, count = numbers[known], first[known], count[known]
    top, foot = (np.full(shape, np.nan) for _ in range(2))
    for into, percent in ((top, _TOP_PERCENT), (foot, _FOOT_PERCENT)):
        into.ravel()[numbers] = z[first + (count - 1) * percent // 100]
    seen = np.isfinite(foot)
    if not seen.any():
        return Look(np.zeros(shape), np.zeros(shape), top, foot)
    nearest = ndimage.distance_transform_edt(~seen, return_distances=False, return_indices=True)
    around = ndimage.median_filter(foot[tuple(nearest)], _AROUND)
    height = np.where(seen, top - around, np.nan)
    rock = seen & (np.nan_to_num(height) > options.stereo_rock_m)
    gx, gy = np.meshgrid(grid.x, grid.y)
    weight = np.where(seen, _weight(np.hypot(gx - camera.centre[0], gy - camera.centre[1]), options), 0.0)
    return Look(
        weight,
        np.where(rock, _log_odds(_STEREO_SURE), 0.0),
        np.where(rock, height, np.nan),
        np.where(rock, around, foot),
    )


def _log_odds(confidence: float) -> float:
    """Of a rock by a detection: no confidence tells nothing, and none tells for sure."""
    sure = min(0.5 + 0.5 * confidence, _MOST_SURE)
    return math.log(sure / (1 - sure))


def _weight(distance: np.ndarray, options: MapOptions) -> np.ndarray:
    return np.asarray(np.minimum(1.0, (options.full_weight_m / np.maximum(distance, 1e-6)) ** 2))


def _parts(centres: np.ndarray, cell: float) -> np.ndarray:
    offsets = (np.arange(_PARTS) + 0.5) / _PARTS - 0.5
    return np.asarray((centres[:, None] + cell * offsets).ravel())


def _near(values: np.ndarray, eye: float, options: MapOptions) -> slice:
    return slice(*np.searchsorted(values, [eye - options.farthest_m, eye + options.farthest_m]).tolist())


def _cells(values: np.ndarray, how: str) -> np.ndarray:
    rows, columns = values.shape
    parts = values.reshape(rows // _PARTS, _PARTS, columns // _PARTS, _PARTS)
    return np.asarray(getattr(parts, how)(axis=(1, 3)))
