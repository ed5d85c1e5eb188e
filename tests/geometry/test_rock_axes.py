import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from polarsim.errors import ReconstructionError
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.rock_axes import (
    FOOT,
    caliper_axes,
    exposed_mesh,
    exposed_points,
    exposed_sizes,
    height_above,
    plan_sides,
)
from polarsim.geometry.topology import hull_faces

FLAT = np.array([[x, y, 0.0] for x in np.linspace(-1, 1, 41) for y in np.linspace(-1, 1, 41)])


def ellipsoid(half: tuple[float, float, float], count: int = 800) -> Mesh:
    """Return the convex hull of evenly distributed points on an ellipsoid with given half axes."""
    number = np.arange(count) + 0.5
    z, turn = 1 - 2 * number / count, np.pi * (1 + 5**0.5) * number
    points = np.stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z], axis=1) * half
    return Mesh(points, hull_faces(points))


@settings(max_examples=20, deadline=None)
@given(angles=st.tuples(*[st.floats(-3, 3)] * 3), shift=st.tuples(*[st.floats(-5, 5)] * 3))
def test_axes_of_an_ellipsoid_do_not_depend_on_pose(angles, shift):
    pose = Rotation.from_rotvec(angles)
    axes = caliper_axes(pose.apply(ellipsoid((0.15, 0.1, 0.06)).vertices) + shift)
    np.testing.assert_allclose(axes.lengths, [0.3, 0.2, 0.12], rtol=0.01)
    long_axis = pose.apply([1.0, 0, 0])
    assert abs(axes.directions[0] @ long_axis) > 0.999
    assert np.sin(axes.plunge) == pytest.approx(abs(long_axis[2]), abs=0.05)


def test_trend_is_counted_from_x_towards_y():
    pose = Rotation.from_euler("z", 30, degrees=True)
    axes = caliper_axes(pose.apply(ellipsoid((0.15, 0.1, 0.06)).vertices))
    assert np.degrees(axes.trend) == pytest.approx(30, abs=2)
    assert np.degrees(axes.plunge) == pytest.approx(0, abs=2)


def test_a_half_buried_sphere_has_half_the_volume_and_its_radius_as_height():
    exposed, volume = exposed_mesh(ellipsoid((0.1, 0.1, 0.1)), FLAT)
    assert volume == pytest.approx(2 / 3 * np.pi * 0.1**3, rel=0.01)
    assert exposed.height == pytest.approx(0.1, rel=0.01)
    assert exposed.diameter == pytest.approx(0.2, rel=0.01)
    np.testing.assert_allclose(exposed.axes.lengths, [0.2, 0.2, 0.1], rtol=0.02)


def test_a_slope_under_a_rock_does_not_change_its_height():
    shear = np.array([[1, 0, 0.3], [0, 1, 0], [0, 0, 1]])  # z + 0.3 x
    mesh = ellipsoid((0.1, 0.1, 0.1))
    exposed, volume = exposed_mesh(Mesh(mesh.vertices @ shear, mesh.faces), FLAT @ shear)
    level, level_volume = exposed_mesh(mesh, FLAT)
    assert (exposed.height, volume) == pytest.approx((level.height, level_volume), rel=1e-3)


def test_the_ground_under_a_rock_is_that_of_its_surroundings():
    under = (np.abs(FLAT[:, :2]) < 0.08).all(axis=1)
    dug = FLAT - np.array([0, 0, 0.03]) * under[:, None]
    mesh = ellipsoid((0.15, 0.15, 0.1))
    np.testing.assert_allclose(height_above(dug, mesh.vertices), mesh.vertices[:, 2], atol=1e-9)


def test_the_foot_of_a_scanned_rock_reaches_the_ground():
    points = np.array([[0, 0, 0.1], [0.05, 0, FOOT / 2], [0, 0.05, FOOT / 2], [-0.05, -0.05, 0.01], [0, 0, -0.01]])
    exposed, above = exposed_points(points, points[:, 2])
    assert len(exposed) == 6  # four above the ground, two of them also on the ground
    np.testing.assert_allclose(np.sort(above)[:2], 0)
    np.testing.assert_allclose(exposed[above == 0, :2], points[1:3, :2])
    assert exposed_sizes(exposed, above).height == pytest.approx(0.1)


def test_sides_in_plan_are_those_of_a_rectangle():
    corners = Rotation.from_euler("z", 20, degrees=True).apply([[x, y, 0] for x in (0, 0.3) for y in (0, 0.004)])
    length, width = plan_sides(corners)
    assert length == pytest.approx(np.hypot(0.3, 0.004))
    assert width == pytest.approx(0.008, rel=0.01)  # perpendicular to the diagonal


def test_axes_of_a_block_are_its_sides():
    block = np.array([[x, y, z] for x in (0, 0.3) for y in (0, 0.2) for z in (0, 0.1)])
    axes = caliper_axes(Rotation.from_rotvec([0.3, 1.2, -0.5]).apply(block))
    np.testing.assert_allclose(axes.lengths, [0.3, 0.2, 0.1])


@pytest.mark.parametrize("points", [np.zeros((0, 3)), np.zeros((9, 3)), np.eye(3)])
def test_points_without_volume_are_refused(points):
    with pytest.raises(ReconstructionError):
        caliper_axes(points)


def test_a_rock_beyond_the_ground_is_refused():
    with pytest.raises(ReconstructionError, match="beyond the ground"):
        height_above(FLAT, np.array([[1.2, 0.0, 0.0], [1.3, 0.1, 0.0]]))
