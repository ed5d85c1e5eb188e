"""Matches between left and right photos of a rough ground: vertical offsets are errors of the rig."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates

from polarsim.geometry.casters import make_caster
from polarsim.geometry.heightfields import grid_mesh
from polarsim.geometry.patches import MatchingOptions, cast_stereo, match_stereo_windows
from polarsim.geometry.poses import Pose, camera_pose
from polarsim.geometry.stereo import StereoRig
from polarsim.photo import BLACK_LEVEL
from tests.support.polar_rig import default_rig

SCALE = 0.25
FULL = default_rig()
RIG = StereoRig(FULL.left.scaled(SCALE), FULL.right.scaled(SCALE), FULL.left_from_right)
POSE = camera_pose(np.array([3.6, -0.4, 1.5]), np.pi, np.radians(27))
WINDOW = MatchingOptions(half=10, search=5, step=12, likeness=0.7, noise=0.4)
CELLS = 161


@pytest.fixture(scope="module")
def ground():
    """Bumps with a texture: ray casts, and the photo of a camera."""
    rng = np.random.default_rng(4)
    axis = np.linspace(-2, 2, CELLS)
    x, y = np.meshgrid(axis, axis)
    height = 0.3 * gaussian_filter(rng.normal(size=x.shape), 6)
    pattern = gaussian_filter(rng.normal(size=(1200, 1200)), 3)
    mesh = grid_mesh(x, y, height)
    rays = make_caster(mesh.vertices, mesh.faces)

    def photo(lens, pose):
        directions = pose.rotate(lens.pixel_directions()).reshape(-1, 3)
        distance, _ = rays.nearest(np.broadcast_to(pose.translation, directions.shape), directions)
        hit = np.isfinite(distance)
        position = (pose.translation + distance[hit, None] * directions[hit])[:, :2]
        grey = np.zeros(len(directions))
        grey[hit] = 1000 + 15000 * map_coordinates(pattern, ((position[:, ::-1] + 2) / 4 * 1199).T, order=1)
        return (BLACK_LEVEL + np.clip(grey, 0, 3000)).reshape(lens.shape).astype(np.float32)

    return rays, photo(RIG.left, POSE), photo(RIG.right, POSE @ RIG.left_from_right)


def ties_under(ground, rig):
    rays, left, right = ground
    return match_stereo_windows(cast_stereo(rays, POSE, rig), left, right, WINDOW)


def test_windows_have_no_offset_with_the_true_rig(ground):
    ties = ties_under(ground, RIG)
    off = ties.right - ties.expected
    assert len(off) > 300
    assert len(off) > 0.8 * ties.tried
    np.testing.assert_allclose(np.median(off, axis=0), 0, atol=0.03)  # px of the shrunk photos
    assert np.median(np.abs(off)) < 0.1


def test_expected_pixels_are_projections_of_the_points(ground):
    ties = ties_under(ground, RIG)
    np.testing.assert_allclose(RIG.left.project(ties.points_left), ties.left, atol=1e-3)
    seen = RIG.right.project(RIG.left_from_right.inverse().apply(ties.points_left))
    np.testing.assert_allclose(seen, ties.expected, atol=1e-3)


def test_a_rotation_about_x_causes_vertical_offsets(ground):
    rotated = replace(RIG, left_from_right=RIG.left_from_right @ Pose.from_rotvec(np.radians([0.2, 0, 0]), np.zeros(3)))
    off = np.median((ties := ties_under(ground, rotated)).right - ties.expected, axis=0)
    assert abs(off[1]) == pytest.approx(np.radians(0.2) * RIG.right.fy, abs=0.1)
    assert abs(off[0]) < 0.1


def test_exchanged_photos_have_few_matches(ground):
    rays, left, right = ground
    ties = match_stereo_windows(cast_stereo(rays, POSE, RIG), right, left, WINDOW)
    assert len(ties.right) < 0.15 * ties.tried


def test_parts_hidden_from_the_right_camera_are_skipped(ground):
    rays, _, _ = ground
    seen = cast_stereo(rays, POSE, RIG)
    known = np.isfinite(seen.in_right[..., 0])
    assert (seen.in_right[known] > 0).all()
    assert (seen.in_right[known] < [RIG.right.width, RIG.right.height]).all()
    assert np.isfinite(seen.points_left[known]).all()
    assert 0 < known.mean() < np.isfinite(seen.points_left[..., 0]).mean()


def test_windows_of_noise_are_skipped(ground):
    rays, left, _ = ground
    rng = np.random.default_rng(5)
    dark = [(BLACK_LEVEL + rng.normal(20, 3, left.shape)).astype(np.float32) for _ in "LR"]
    assert match_stereo_windows(cast_stereo(rays, POSE, RIG), *dark, WINDOW).tried == 0
