import numpy as np
import pytest

from polarsim.geometry.stereo import default_rig, rectified_left


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


def test_a_far_point_has_nearly_the_same_direction_in_both_cameras():
    rig = default_rig()
    point = np.array([0.0, 0.0, 1000.0])
    in_right = rig.left_from_right.inverse().apply(point)
    angle = np.degrees(np.arccos(in_right[2] / np.linalg.norm(in_right)))
    assert angle < 0.2  # R and T of the calibration rotate by 0.16 degrees


def test_cameras_are_selected_by_letter():
    rig = default_rig()
    assert rig.lens("L") is rig.left
    assert rig.lens("R") is rig.right
    np.testing.assert_array_equal(rig.left_from("L").matrix, np.eye(4))
    assert rig.left_from("R") is rig.left_from_right
