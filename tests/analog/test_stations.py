import numpy as np
import pytest

from polarsim.analog.options import AnalogOptions
from polarsim.analog.stations import make_stations
from polarsim.geometry.poses import yaw_pitch_roll
from polarsim.site import polar


@pytest.mark.parametrize("terrain", [1, 3, 6, 11, 13])
def test_lamps_are_10_to_20_cm_from_the_survey(terrain):
    lamps = make_stations(polar(), terrain, AnalogOptions()).lamps
    for azimuth, surveyed in polar().lamps.items():
        assert 0.1 <= np.linalg.norm(lamps[azimuth] - surveyed.point) <= 0.2


def test_tripods_are_at_the_positions_fitted_to_the_real_labels():
    stations = make_stations(polar(), 1, AnalogOptions())
    for position, (x, y) in {"A": (3.6, -0.4), "B": (6.1, -0.45), "C": (0.8, -3.65)}.items():
        pose = stations.sandbox_from_left[position]
        np.testing.assert_allclose(pose.translation[:2], [x, y], atol=0.11)
        assert 1.4 < pose.translation[2] < 1.7
        assert 22 <= np.degrees(yaw_pitch_roll(pose)[1]) <= 28


def test_stations_depend_on_terrain_and_seed():
    points = [
        make_stations(polar(), terrain, AnalogOptions(seed=seed)).sandbox_from_left["A"].translation
        for terrain, seed in ((1, 1), (3, 1), (1, 2))
    ]
    assert np.linalg.norm(points[0] - points[1]) > 0.005
    assert np.linalg.norm(points[0] - points[2]) > 0.005
    np.testing.assert_array_equal(
        points[0], make_stations(polar(), 1, AnalogOptions()).sandbox_from_left["A"].translation
    )


def test_the_calibration_has_small_errors():
    stations = make_stations(polar(), 1, AnalogOptions())
    for true, stated in (
        (stations.rig.left, stations.calibration.left),
        (stations.rig.right, stations.calibration.right),
    ):
        assert 0 < abs(true.fx - stated.fx) < 5
        assert 0 < abs(true.cx - stated.cx) < 5
        assert 0 < abs(true.distortion[0] - stated.distortion[0]) < 0.01
    moved = stations.rig.left_from_right.translation - stations.calibration.left_from_right.translation
    assert 0 < np.linalg.norm(moved) < 0.002


def test_the_rover_light_is_between_the_cameras():
    stations = make_stations(polar(), 3, AnalogOptions())
    left, right = (stations.camera("A", camera).centre for camera in "LR")
    lamp = stations.lamps_at("A")["rover"]
    assert np.linalg.norm(lamp - (left + right) / 2) < 0.03
