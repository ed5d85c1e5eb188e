from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from polarsim.geometry.poses import Pose
from polarsim.geometry.stereo import StereoRig, epipolar_distances, rectified_left, triangulated_depth
from tests.support.polar_rig import default_rig


def test_the_rectified_grid_of_the_stated_calibration():
    lens = rectified_left(default_rig()).lens
    matrix = lens.opencv_matrix()
    # Output of OpenCV 4 and 5 for terrain 11's calibration (published maps: 1991.49, 966.256, 600.347).
    assert matrix[0, 0] == pytest.approx(1990.61, abs=0.1)
    assert matrix[1, 1] == pytest.approx(1990.61, abs=0.1)
    assert matrix[0, 2] == pytest.approx(966.21, abs=0.1)
    assert matrix[1, 2] == pytest.approx(600.08, abs=0.1)
    assert not any(lens.distortion)


def test_the_baseline_is_parallel_to_the_rectified_rows():
    rig = default_rig()
    grid = rectified_left(rig)
    baseline = grid.left_from_rectified.inverse().rotate(rig.left_from_right.translation)
    np.testing.assert_allclose(baseline, [0.301560, 0, 0], atol=2e-6)  # the length of T


def images_of(points, rig):
    """Return pixels of points (n, 3), left frame, in both images."""
    return rig.left.project(points), rig.right.project(rig.left_from_right.inverse().apply(points))


@settings(max_examples=30)
@given(seed=st.integers(0, 2**32 - 1), rotvec=st.tuples(*[st.floats(-0.05, 0.05)] * 3))
def test_images_of_a_point_are_on_its_epipolar_lines_and_give_its_depth(seed, rotvec):
    rng = np.random.default_rng(seed)
    rig = replace(default_rig(), left_from_right=Pose.from_rotvec(np.array(rotvec), np.array([0.3, 0.01, -0.005])))
    points = rng.uniform((-1, -0.6, 2), (1, 0.6, 6), (50, 3))
    left, right = images_of(points, rig)
    np.testing.assert_allclose(epipolar_distances(rig, left, right), 0, atol=1e-6)
    np.testing.assert_allclose(triangulated_depth(rig, left, right), points[:, 2], rtol=1e-6)


def test_the_distance_of_a_pinhole_pair_is_the_vertical_offset_over_the_root_of_two():
    lens = replace(default_rig().left, distortion=(0.0,) * 5, fx=2000.0, fy=2000.0)
    rig = StereoRig(lens, lens, Pose(np.eye(3), np.array([0.3, 0, 0])))
    left, right = images_of(np.array([[0.2, 0.1, 3.0]]), rig)
    distance = epipolar_distances(rig, left, right + np.array([0, 4]))
    assert distance == pytest.approx(4 / np.sqrt(2))  # Sampson: half of the squared offset for each image


def test_exchanged_images_have_negative_depth():
    rig = default_rig()
    left, right = images_of(np.random.default_rng(0).uniform((-1, -0.6, 2), (1, 0.6, 6), (50, 3)), rig)
    assert (triangulated_depth(rig, right, left) < 0).all()
