"""Camera poses of novel views."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from polarsim.errors import ConfigError, RenderError
from polarsim.render.views.cameras import cameras_of, curve, looking_at, pinhole
from polarsim.render.views.plan import NamedScene
from polarsim.site import polar

PLACES = st.tuples(*[st.floats(-5, 5)] * 3).map(np.array)
LEVEL = lambda points: np.zeros(len(points))  # noqa: E731


@settings(max_examples=40)
@given(PLACES, PLACES, st.floats(-3, 3), st.floats(10, 120))
def test_the_target_projects_to_the_image_centre_and_cameras_without_roll_are_upright(position, target, roll, hfov_deg):
    assume(np.hypot(*(target - position)[:2]) > 1e-3)
    right, down, _ = looking_at(position, target).rotation.T
    assert abs(right[2]) < 1e-12
    assert down[2] < 0
    lens = pinhole(hfov_deg, 640, 480)
    pixel = lens.project(looking_at(position, target, roll).inverse().apply(target))
    np.testing.assert_allclose(pixel, [320, 240], atol=1e-6)


def test_directions_and_curves_between_equal_points_are_rejected():
    with pytest.raises(ConfigError):
        looking_at(np.array([1.0, 2, 3]), np.array([1.0, 2, 3]))
    with pytest.raises(ConfigError):
        curve(np.array([[0.0, 0, 0], [1, 0, 0], [1, 0, 0]]), 4)


@settings(max_examples=30)
@given(st.lists(PLACES, min_size=2, max_size=6), st.integers(2, 20))
def test_a_curve_starts_and_ends_at_its_waypoints_and_divides_its_length_evenly(waypoints, number):
    points = np.array(waypoints)
    assume(np.linalg.norm(np.diff(points, axis=0), axis=1).min() > 0.1)
    along, _ = curve(points, number)
    np.testing.assert_allclose(along[[0, -1]], points[[0, -1]], atol=1e-9)
    fine, _ = curve(points, 200 * (number - 1) + 1)
    lengths = np.linalg.norm(np.diff(fine, axis=0), axis=1).reshape(number - 1, 200).sum(axis=1)
    np.testing.assert_allclose(lengths, lengths.mean(), rtol=0.05)


def test_a_curve_through_waypoints_on_a_line_is_that_line():
    points, ahead = curve(np.array([[0.0, 0, 0], [1, 0, 0], [5, 0, 0]]), 11)
    np.testing.assert_allclose(points, np.linspace([0, 0, 0], [5, 0, 0], 11), atol=1e-3)
    np.testing.assert_allclose(ahead[:, 1:], 0, atol=1e-12)


def test_orbit_cameras_face_the_centre_at_the_radius(views_of):
    orbit = {"kind": "orbit", "centre_m": [0.5, 0, 0.1], "radius_m": 2, "height_m": 1, "number": 4, "from_deg": 90}
    cameras = cameras_of(views_of(cameras=[orbit]), LEVEL)
    points = np.array([camera.centre for camera in cameras])
    np.testing.assert_allclose(points, [[0.5, 2, 1.1], [-1.5, 0, 1.1], [0.5, -2, 1.1], [2.5, 0, 1.1]], atol=1e-12)
    for camera in cameras:
        pixel = camera.project(np.array([0.5, 0, 0.1]))
        np.testing.assert_allclose(pixel, [48, 32], atol=1e-9)
    assert [camera.name for camera in cameras] == ["orbit-000", "orbit-001", "orbit-002", "orbit-003"]


def test_half_an_orbit_ends_at_its_end(views_of):
    orbit = {"kind": "orbit", "radius_m": 1, "height_m": 0, "number": 3, "over_deg": 180}
    points = [c.centre for c in cameras_of(views_of(cameras=[orbit]), LEVEL)]
    np.testing.assert_allclose(points, [[1, 0, 0], [0, 1, 0], [-1, 0, 0]], atol=1e-12)


def test_a_path_without_a_target_looks_ahead_and_down(views_of):
    path = {"kind": "path", "waypoints_m": [[0, 0, 1], [0, 3, 1]], "number": 3, "pitch_deg": 20}
    for camera in cameras_of(views_of(cameras=[path]), LEVEL):
        ahead = camera.world_from_camera.rotation[:, 2]
        np.testing.assert_allclose(ahead, [0, np.cos(np.radians(20)), -np.sin(np.radians(20))], atol=1e-12)


def test_random_cameras_have_clearance_and_are_reproducible(views_of):
    box = {"kind": "random", "number": 30, "low_m": [-2, -2, 0], "high_m": [2, 2, 2], "clearance_m": 0.5}

    def hill(points):
        return 1.2 - np.abs(points).max(axis=1)

    views = views_of(cameras=[box])
    first, second = (cameras_of(views, hill) for _ in range(2))
    points = np.array([camera.centre for camera in first])
    assert (points[:, 2] >= hill(points[:, :2]) + 0.5).all()
    assert (np.abs(points) <= 2).all()
    assert len(points) == 30
    np.testing.assert_array_equal(points, [camera.centre for camera in second])
    with pytest.raises(RenderError):
        cameras_of(views, lambda points: np.full(len(points), 5.0))


def test_stereo_pairs_have_the_baseline_and_are_parallel(views_of):
    left, right = cameras_of(views_of(stereo=True), LEVEL)
    assert (left.name, right.name) == ("point-000L", "point-000R")
    apart = left.world_from_camera.inverse().apply(right.centre)
    np.testing.assert_allclose(apart, [0.3, 0, 0], atol=1e-12)
    np.testing.assert_allclose(left.world_from_camera.rotation, right.world_from_camera.rotation)


def test_a_pinhole_has_the_given_field_of_view():
    lens = pinhole(90, 200, 100)
    left, right = lens.directions(np.array([[0.0, 50], [200, 50]]))
    np.testing.assert_allclose([left[0], right[0]], [-1, 1], atol=1e-12)


def test_the_lens_of_a_localised_rig_is_used_and_scaled(views_of, folders, lens):
    (stated,) = cameras_of(views_of(lens={"kind": "rig"}), LEVEL)
    assert (stated.lens.width, stated.lens.height) == (1936, 1216)
    placed = {"kind": "rig", "localised": folders / "cameras/PosA.json"}
    (camera,) = cameras_of(views_of(lens=placed), LEVEL, scale=0.5)
    assert camera.lens == lens.scaled(0.5)


def test_heights_are_those_of_the_highest_surface(views_of):
    views = views_of()
    heights = NamedScene(views.scenes[0], views.render, polar()).heights(np.array([[0.0, 0], [1, 1], [50, 0]]))
    np.testing.assert_allclose(heights, [0.2, 0, -np.inf], atol=1e-6)
