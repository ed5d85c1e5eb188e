"""Ground in the front camera's picture: position and size of rocks estimated from boxes, and cells of hazard maps.

The lower side of a box marks the near edge of the footprint. The box's width at this distance is the width and the
depth of the rock. The upper side marks the top, above the centre of the footprint. The ground is the plane under the
wheels, or the ground as surveyed before the drive. Both hazard maps use this module: that of a recorded drive, which
`rover_onboard` scores (`hazard_map`), and that by which the rover drives (`hazard_grid`, `map_updates`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from polarsim.geometry.camera import Camera
from polarsim.geometry.casters import make_caster
from polarsim.geometry.poses import Pose
from polarsim.rover.vehicle.table import Vehicle
from polarsim.rover.world.surface import World

HeightFunction = Callable[[np.ndarray, np.ndarray], np.ndarray]  # height of the ground, m, at world x and y, m
CELL_M = 0.15  # side of a cell, as in NASA's Lunar Autonomy Challenge
_LEAST_FALL = 0.02  # minimum fall of a ray per metre; flatter rays reach the ground too far away
_ROUNDS = 12  # iterations along a ray; each multiplies the error by the ground's slope divided by the ray's fall
_RIM_PX = 2.0  # boxes closer to the picture's edge are cut off: position and size of their rocks are unknown
_ABOVE_M = 1.0  # height above all surfaces at which vertical rays start


@dataclass(frozen=True)
class Estimate:
    """Estimated rocks (n); world frame, metres."""

    near: np.ndarray  # (n, 2) intersection of the box's lower side with the ground
    centre: np.ndarray  # (n, 2) centre of the footprint
    width: np.ndarray  # (n,)
    height: np.ndarray  # (n,) not negative


def ground_below(vehicle: Vehicle) -> float:
    """Return the height of the ground below the wheels in base_link, m."""
    return float(np.mean([wheel.position_m[2] - wheel.outer_radius_m for wheel in vehicle.wheels]))


def plane_under(world_from_base: Pose, ground_m: float) -> HeightFunction:
    """Return the plane at height `ground_m` of base_link."""
    foot, up = world_from_base.apply(np.array([0.0, 0, ground_m])), world_from_base.rotation[:, 2]
    return lambda x, y: np.asarray(foot[2] - ((x - foot[0]) * up[0] + (y - foot[1]) * up[1]) / up[2])


def estimate(boxes: np.ndarray, camera: Camera, ground: HeightFunction) -> Estimate:
    """Estimate the rocks of boxes (n, 4); NaN if the ray of the lower side does not reach the ground."""
    boxes = np.asarray(boxes, float).reshape(-1, 4)
    left, top, right, bottom = boxes.T
    eye = camera.centre
    near = _intersect_ground(np.stack([(left + right) / 2, bottom], axis=1), camera, ground)
    depth = camera.world_from_camera.inverse().apply(near)[:, 2]
    width = (right - left) / camera.lens.fx * depth
    ahead = near[:, :2] - eye[:2]
    reach = np.hypot(*ahead.T)
    direction = ahead / np.where(reach > 0, reach, 1.0)[:, None]
    centre = near[:, :2] + direction * (width / 2)[:, None]
    upper = camera.directions(np.stack([(left + right) / 2, top], axis=1))
    rise = upper[:, 2] / np.maximum(np.hypot(upper[:, 0], upper[:, 1]), 1e-9)
    height = eye[2] + rise * (reach + width / 2) - near[:, 2]
    return Estimate(near[:, :2], centre, width, np.maximum(height, 0))


def _intersect_ground(pixels: np.ndarray, camera: Camera, ground: HeightFunction) -> np.ndarray:
    """Return (n, 3) intersections of rays through pixels (n, 2) with the ground; NaN if there is none."""
    rays, eye = camera.directions(pixels), camera.centre
    falls = -rays[:, 2] > _LEAST_FALL * np.hypot(rays[:, 0], rays[:, 1])
    rays = np.where(falls[:, None], rays, np.nan)
    level = ground(*eye[:2, None]) + np.zeros(len(rays))
    points = np.full((len(rays), 3), np.nan)
    for _ in range(_ROUNDS):
        points = eye + ((level - eye[2]) / rays[:, 2])[:, None] * rays
        finite = np.isfinite(points).all(axis=1)
        level = np.where(finite, ground(*np.where(finite[:, None], points, 0)[:, :2].T), level)
    return np.asarray(points)


@dataclass(frozen=True)
class GroundView:
    """Points of the ground around a camera, in its picture, and the rocks of boxes."""

    window: tuple[slice, slice]  # rows and columns of the points
    points: np.ndarray  # (rows, columns, 3)
    pixel: np.ndarray  # (rows, columns, 2)
    distance: np.ndarray  # (rows, columns) horizontal distance from the camera, m
    inside: np.ndarray  # (rows, columns) bool: in the picture, in range, and outside boxes that are cut off
    whole: np.ndarray  # (n,) bool: boxes that are not cut off
    rocks: Estimate  # of these boxes


def view_ground(
    x: np.ndarray,
    y: np.ndarray,
    camera: Camera,
    ground: HeightFunction,
    boxes: np.ndarray,
    range_m: tuple[float, float],
) -> GroundView:
    """Project the points of the ground at x (columns,), y (rows,) in a range of distances, and locate boxes (n, 4)."""
    centre, reach = camera.centre, range_m[1]
    columns, rows = (
        slice(*np.searchsorted(values, [eye - reach, eye + reach]).tolist())
        for values, eye in zip((x, y), centre[:2], strict=True)
    )
    gx, gy = np.meshgrid(x[columns], y[rows])
    points = np.stack([gx, gy, ground(gx, gy)], axis=-1)
    pixel = camera.project(points)
    distance = np.linalg.norm((points - centre)[..., :2], axis=-1)
    inside = camera.inside(pixel) & (distance >= range_m[0]) & (distance <= reach)
    cut = (boxes[:, :2] < _RIM_PX).any(axis=1) | (boxes[:, 2:] > camera.size - _RIM_PX).any(axis=1)
    for box in boxes[cut]:
        inside &= ~((pixel > box[:2]) & (pixel < box[2:])).all(axis=-1)
    rocks = estimate(boxes[~cut], camera, ground)
    return GroundView((rows, columns), points, pixel, distance, inside, np.asarray(~cut), rocks)


def rocks_on_ground(rocks: Estimate, x: np.ndarray, y: np.ndarray) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
    """Yield index, footprint (...) bool and rise (...), m, of each rock at points x, y.

    A rock is the upper half of an ellipsoid over a circular footprint. Rocks without a position are skipped.
    """
    for number, (centre, width, height) in enumerate(zip(rocks.centre, rocks.width, rocks.height, strict=True)):
        if np.isfinite(centre).all() and width > 0:
            squared = ((x - centre[0]) ** 2 + (y - centre[1]) ** 2) / (width / 2) ** 2
            covered = squared < 1
            yield number, covered, np.where(covered, height * np.sqrt(np.maximum(1 - squared, 0)), 0.0)


def true_surface(world: World, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return heights of the ground and of rocks, m, at points x, y; -inf outside rocks."""
    ground = world.height_at(x, y)
    top = float(max(world.vertices[:, 2].max(initial=-np.inf), ground.max())) + _ABOVE_M
    distance = np.full(x.size, np.inf)
    if len(world.triangles):
        origins = np.stack([x.ravel(), y.ravel(), np.full(x.size, top)], axis=1)
        distance, _ = make_caster(world.vertices, world.triangles).nearest(origins, np.tile([0.0, 0, -1], (x.size, 1)))
    return ground, top - np.reshape(distance, x.shape)


def grid_points(world: World, parts: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Return x (columns,) and y (rows,) of the centres of cells, or of parts of cells, inside a world's ground."""
    step = CELL_M / parts
    x, y = (
        start + step * (np.arange(int((end - start) / CELL_M) * parts) + 0.5)
        for start, end in ((world.x[0], world.x[-1]), (world.y[0], world.y[-1]))
    )
    return x, y


def part_centres(centres: np.ndarray, cell_m: float, parts: int) -> np.ndarray:
    """Return coordinates (n * parts,) of the centres of the parts of cells with centres (n,)."""
    offsets = cell_m * ((np.arange(parts) + 0.5) / parts - 0.5)
    return np.asarray((centres[:, None] + offsets).ravel())


def by_cells(values: np.ndarray, parts: int) -> np.ndarray:
    """Return values of parts of cells as (rows, parts, columns, parts)."""
    rows, columns = values.shape
    return values.reshape(rows // parts, parts, columns // parts, parts)
