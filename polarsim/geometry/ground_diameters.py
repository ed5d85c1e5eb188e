"""Positions and diameters of rocks from boxes in photos with known cameras, on level ground."""

from __future__ import annotations

import numpy as np

from polarsim.geometry.camera import Camera

MIN_DEPRESSION = np.radians(5)  # minimum angle between a ray and the horizon: farther points are uncertain


def ground_diameters(camera: Camera, boxes: np.ndarray, level: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return plan centres (n, 2) and diameters (n,) of rocks, metres, NaN for boxes near or above the horizon.

    `boxes` (n, 4): x0, y0, x1, y1, px. `level`: height of the ground, metres, sandbox frame.

    The centre of the lower edge of a box is the foot of the front of the rock. The rays through the centres of the left
    and the right edge enclose the rock, which is a vertical cylinder: its axis is half a diameter behind the foot.
    """
    boxes = np.asarray(boxes, float).reshape(-1, 4)
    x0, y0, x1, y1 = boxes.T
    middle = (y0 + y1) / 2
    eye = camera.centre
    foot_ray, left, right = (
        camera.directions(np.stack(part, axis=1)) for part in (((x0 + x1) / 2, y1), (x0, middle), (x1, middle))
    )
    down = -foot_ray[:, 2] / np.linalg.norm(foot_ray, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.where(down > np.sin(MIN_DEPRESSION), (eye[2] - level) / -foot_ray[:, 2], np.nan)
    foot = distance[:, None] * foot_ray[:, :2]  # in plan, from the camera
    reach = np.linalg.norm(foot, axis=1)
    angle = np.abs(np.arctan2(_cross(left, right), (left[:, :2] * right[:, :2]).sum(axis=1)))  # in plan
    sine = np.sin(angle / 2)
    radius = reach * sine / (1 - sine)  # tangents of a circle at a distance of reach + radius
    centre = eye[:2] + foot * (1 + radius / reach)[:, None]
    return centre, 2 * radius


def _cross(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return np.asarray(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
