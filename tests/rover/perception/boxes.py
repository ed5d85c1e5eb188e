"""Boxes of upright boards in front of a rover that drives along x, for tests of perception metrics."""

import numpy as np
import pandas as pd

from polarsim.geometry.poses import Pose
from polarsim.rover.perception.detections import detection_table
from polarsim.rover.perception.sightings import FrontCameraDrive
from polarsim.rover.vehicle.camera_names import FRONT
from polarsim.rover.vehicle.mounts import mount_of
from tests.rover import driven

CONFIDENCE = 0.3
MOUNT = mount_of(driven.vehicle().camera(FRONT))
GROUND = -0.25
CAMERA = MOUNT.at(Pose.identity())  # base_link is the world frame


def level(x, y):
    return np.full(np.shape(x), GROUND)


def ride(frames=10, step=0.2):
    """Return a drive along +x from x = 0."""
    cameras = {n: MOUNT.at(Pose(np.eye(3), np.array([step * n, 0, 0.25]))) for n in range(frames)}
    path = np.concatenate([np.stack([np.linspace(0, step * frames, 50), np.full(50, y)], 1) for y in (0.6, -0.6)])
    return FrontCameraDrive(
        list(range(frames)), cameras, MOUNT.base_from_camera, GROUND, 0.17, 0.71, path, 0.1,
        step * frames, 0.2,
    )  # fmt: skip


def box_of(x, y, width, height, base_x=0.0):
    """Return the box (4,) around an upright board on the ground at (x, y) in base_link, facing the camera."""
    corners = np.array([[x - base_x, y + s * width / 2, GROUND + h] for s in (-1, 1) for h in (0, height)])
    pixels = MOUNT.lens.project(MOUNT.base_from_camera.inverse().apply(corners))
    return np.concatenate([pixels.min(axis=0), pixels.max(axis=0)])


def table(rows):
    """Return detections for rows of (frame, box, confidence)."""
    return detection_table([(frame, "rock", confidence, *box) for frame, box, confidence in rows])


def truth_table(rows):
    """Return labels for rows of (frame, rock, box, distance, height)."""
    return pd.DataFrame(
        [(f, 0.1 * f, "rock", r, *box, 500, d, h) for f, r, box, d, h in rows],
        columns=["frame", "time_s", "kind", "rock", "x0", "y0", "x1", "y1", "pixels", "distance_m", "height_m"],
    )
