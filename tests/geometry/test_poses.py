import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.errors import FormatError
from polarsim.geometry.poses import Pose, camera_pose, fit_pose, yaw_pitch_roll

angle = st.floats(-3.0, 3.0)
length = st.floats(-10, 10)


@st.composite
def any_pose(draw):
    return Pose.from_rotvec(
        np.array([draw(angle), draw(angle), draw(angle)]) / 2, np.array([draw(length), draw(length), draw(length)])
    )


POINTS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3], [1, 1, 1]])


@given(any_pose(), any_pose())
def test_products_inverses_and_matrices_map_points(c_from_b, b_from_a):
    mapped = b_from_a.apply(POINTS)
    np.testing.assert_allclose(b_from_a.inverse().apply(mapped), POINTS, atol=1e-12)
    np.testing.assert_allclose((c_from_b @ b_from_a).apply(POINTS), c_from_b.apply(mapped), atol=1e-11)
    homogeneous = np.column_stack([POINTS, np.ones(len(POINTS))])
    np.testing.assert_allclose((homogeneous @ b_from_a.matrix.T)[:, :3], mapped, atol=1e-12)
    np.testing.assert_allclose(Pose.from_matrix(b_from_a.matrix).matrix, b_from_a.matrix, atol=1e-12)


def test_axes_of_a_camera_with_yaw_180_and_pitch_30():
    # Yaw 180 degrees (towards -X), 30 degrees down, level: right is +Y, down has components -Z and -X.
    pose = camera_pose(np.array([3.0, 0, 1.5]), np.pi, np.radians(30))
    half, root = 0.5, np.sqrt(3) / 2
    np.testing.assert_allclose(pose.rotate(np.array([0.0, 0, 1])), [-root, 0, -half], atol=1e-12)
    np.testing.assert_allclose(pose.rotate(np.array([1.0, 0, 0])), [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(pose.rotate(np.array([0.0, 1, 0])), [half, 0, -root], atol=1e-12)


@given(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))
def test_yaw_pitch_and_roll_come_back(yaw, pitch, roll):
    found = yaw_pitch_roll(camera_pose(np.zeros(3), yaw, pitch, roll))
    np.testing.assert_allclose(np.exp(1j * np.array(found)), np.exp(1j * np.array([yaw, pitch, roll])), atol=1e-9)


@given(any_pose())
def test_a_fit_undoes_any_rigid_motion(target_from_source):
    found = fit_pose(POINTS, target_from_source.apply(POINTS))
    np.testing.assert_allclose(found.apply(POINTS), target_from_source.apply(POINTS), atol=1e-9)


@pytest.mark.parametrize(
    "matrix", [np.eye(3), np.diag([1.0, 1, 1.001, 1]), np.diag([1.0, 1, -1, 1]), np.full((4, 4), np.inf)]
)
def test_an_invalid_matrix_is_refused(matrix):
    with pytest.raises(FormatError), np.errstate(invalid="ignore"):
        Pose.from_matrix(matrix)
