"""Position and size of rocks on the ground, estimated from boxes in the front camera's picture.

The lower side of a box marks the near edge of the footprint. The box's width at this distance is the width and the
depth of the rock. The upper side marks the top, above the centre of the footprint. The ground is the plane under the
wheels, or the ground as surveyed before the drive.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from polarsim.geometry.camera import Camera
from polarsim.geometry.poses import Pose

HeightFunction = Callable[[np.ndarray, np.ndarray], np.ndarray]  # height of the ground, m, at world x and y, m
_LEAST_FALL = 0.02  # minimum fall of a ray per metre; flatter rays reach the ground too far away
_ROUNDS = 12  # iterations along a ray; each multiplies the error by the ground's slope divided by the ray's fall


@dataclass(frozen=True)
class Estimate:
    """Estimated rocks (n); world frame, metres."""

    near: np.ndarray  # (n, 2) intersection of the box's lower side with the ground
    centre: np.ndarray  # (n, 2) centre of the footprint
    width: np.ndarray  # (n,)
    height: np.ndarray  # (n,) not negative


def plane_under(world_from_base: Pose, ground_m: float) -> HeightFunction:
    """Return the plane at height `ground_m` of base_link."""
    foot, up = world_from_base.apply(np.array([0.0, 0, ground_m])), world_from_base.rotation[:, 2]

    def heights(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.asarray(foot[2] - ((x - foot[0]) * up[0] + (y - foot[1]) * up[1]) / up[2])

    return heights


def estimate(boxes: np.ndarray, camera: Camera, ground: HeightFunction) -> Estimate:
    """Estimate the rocks of boxes (n, 4); NaN if the ray of the lower side does not reach the ground."""
    boxes = np.asarray(boxes, float).reshape(-1, 4)
    left, top, right, bottom = boxes.T
    eye = camera.centre
    lower = np.stack([(left + right) / 2, bottom], axis=1)
    near = intersect_ground(lower, camera, ground)
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


def intersect_ground(pixels: np.ndarray, camera: Camera, ground: HeightFunction) -> np.ndarray:
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
