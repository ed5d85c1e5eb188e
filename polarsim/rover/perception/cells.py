"""Cells of a map: visibility in a picture, rocks of boxes on cells, and the true surface.

Used by the map of a recorded drive, which `rover_onboard` scores (`hazard_map`), and the map by which the rover drives
(`hazard_grid`, updated by `map_updates` and scored by `planning.challenge`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from polarsim.geometry.camera import Camera
from polarsim.geometry.casters import make_caster
from polarsim.rover.perception.ground_view import Estimate
from polarsim.rover.world.surface import World

CELL_M = 0.15  # side of a cell, as in NASA's Lunar Autonomy Challenge
_RIM_PX = 2.0  # boxes closer to the picture's edge are cut off: position and size of their rocks are unknown
_ABOVE_M = 1.0  # height above all surfaces at which vertical rays start


@dataclass(frozen=True)
class VisiblePoints:
    """Points of the ground in a picture."""

    pixel: np.ndarray  # (..., 2)
    distance: np.ndarray  # (...) horizontal distance from the camera, m
    inside: np.ndarray  # (...) bool: in the picture, in range, and outside boxes that are cut off
    whole: np.ndarray  # (n,) bool: boxes that are not cut off


def visible_points(
    points: np.ndarray, camera: Camera, boxes: np.ndarray, range_m: tuple[float, float]
) -> VisiblePoints:
    """Project points (..., 3) of the world into a picture with boxes (n, 4)."""
    pixel = camera.project(points)
    distance = np.linalg.norm((points - camera.centre)[..., :2], axis=-1)
    inside = camera.inside(pixel) & (distance >= range_m[0]) & (distance <= range_m[1])
    cut = (boxes[:, :2] < _RIM_PX).any(axis=1) | (boxes[:, 2:] > camera.size - _RIM_PX).any(axis=1)
    for box in boxes[cut]:
        inside &= ~((pixel > box[:2]) & (pixel < box[2:])).all(axis=-1)
    return VisiblePoints(pixel, distance, inside, np.asarray(~cut))


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


def part_centres(centres: np.ndarray, cell_m: float, parts: int) -> np.ndarray:
    """Return coordinates (n * parts,) of the centres of the parts of cells with centres (n,)."""
    offsets = cell_m * ((np.arange(parts) + 0.5) / parts - 0.5)
    return np.asarray((centres[:, None] + offsets).ravel())


def by_cells(values: np.ndarray, parts: int) -> np.ndarray:
    """Return values of parts of cells as (rows, parts, columns, parts)."""
    rows, columns = values.shape
    return values.reshape(rows // parts, parts, columns // parts, parts)
