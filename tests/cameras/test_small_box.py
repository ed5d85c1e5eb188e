import numpy as np
import pytest

from polarsim.cameras.small_box import small_box_frame
from polarsim.geometry.poses import Pose, angle_between, camera_pose

HALF = 0.5  # metres
BOX_FROM_LEFT = camera_pose(np.array([2.0, -0.2, 1.25]), np.pi + 0.03, np.radians(30))


def box_on_a_floor(rng: np.random.Generator, half: float = HALF) -> np.ndarray:
    """Return points (n, 3) on a box of sand, the tops of its walls, a rock, a ball next to it and the floor."""
    floor = np.column_stack([rng.uniform(-2.5, 2.5, (200_000, 2)), np.full(200_000, -0.4)])
    floor = floor[(np.abs(floor[:, :2]) > half + 0.03).any(axis=1) & (floor[:, 0] > -1.0)]
    top = np.column_stack([rng.uniform(-half - 0.03, half + 0.03, (30_000, 2)), np.zeros(30_000)])
    top[(np.abs(top[:, :2]) > half).any(axis=1), 2] = 0.05
    top[np.hypot(top[:, 0] - 0.2, top[:, 1]) < 0.05, 2] = 0.07
    hidden = (np.abs(top[:, 0] + 0.1) < 0.05) & (np.abs(top[:, 1]) < 0.1)  # by a rock
    ball = rng.normal(size=(5_000, 3))
    ball = 0.1 * ball / np.linalg.norm(ball, axis=1, keepdims=True) + [0.1, 0.85, -0.3]
    points = np.concatenate([floor, top[~hidden], ball])
    return points + 0.002 * rng.normal(size=points.shape)


@pytest.mark.parametrize("heading", [0.1, 0.7, -0.7])
def test_a_small_box_gives_origin_heading_and_height(rng, heading):
    level_from_box = Pose.from_rotvec(np.array([0, 0, heading]), np.array([1.6, -0.3, 0.4]))
    points = level_from_box.apply(box_on_a_floor(rng))
    found = small_box_frame(points, np.full(2, HALF), [level_from_box @ BOX_FROM_LEFT]) @ level_from_box
    assert np.linalg.norm(found.translation[:2]) < 0.01  # cells of 2 cm
    assert abs(found.translation[2]) < 0.002
    assert np.degrees(angle_between(found, Pose.identity())) < 0.5


def test_a_box_of_another_size_is_ignored(rng):
    points = box_on_a_floor(rng, half=0.9)
    assert small_box_frame(points, np.full(2, HALF), [BOX_FROM_LEFT]) is None


def test_a_bare_floor_has_no_box(rng):
    floor = np.column_stack([rng.uniform(-2.5, 2.5, (100_000, 2)), 0.002 * rng.normal(size=100_000)])
    assert small_box_frame(floor, np.full(2, HALF), [BOX_FROM_LEFT]) is None
