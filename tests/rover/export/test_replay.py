"""Estimates of recorded drives."""

from pathlib import Path

import numpy as np
import pytest

from polarsim.formats.tables import read_parquet
from polarsim.geometry.trajectories import Trajectory, trajectory_errors
from polarsim.rover.drive.state import recorded_states
from polarsim.rover.drive.trace import COLUMNS, CONTACTS
from polarsim.rover.export.replay import replay, stereo_rig, write_estimates
from polarsim.rover.export.sequence import calibration_of
from polarsim.rover.localisation.localiser import Localiser
from polarsim.rover.localisation.sensors import SENSOR_COLUMNS
from polarsim.rover.vehicle.table import read_vehicle
from tests.rover.drives import straight_drive, write_drive

VEHICLE = read_vehicle(Path(__file__).parents[3] / "config/viper.yaml")


def test_recorded_states_have_the_values_of_the_rows():
    trace = straight_drive(0.1)
    for state, row in zip(recorded_states(trace), trace.table[list(COLUMNS)].to_numpy(), strict=True):
        values = [CONTACTS.index(value) if isinstance(value, str) else value for value in row]
        found = state.row(row[COLUMNS.index("offset_m")], row[COLUMNS.index("heading_error_rad")])
        np.testing.assert_array_equal(found, np.array(values, float))


def test_the_replay_reads_the_sensors_in_the_files_and_adds_each_pair_once(tmp_path):
    trace = write_drive(tmp_path, VEHICLE, ("ncl", "ncr"))
    seen: list[tuple[float, int]] = []

    class Watching(Localiser):
        def add_pair(self, left, right):
            assert left.dtype == right.dtype == np.uint8
            seen.append((self._readings[-1][0], int(left.shape[0])))

    localiser = Watching(VEHICLE, 0, 1.62)
    frames = read_parquet(tmp_path / "ncl/poses.parquet")
    files = [tmp_path / f"ncl/1_hapke_0256/{frame:05d}.png" for frame in frames["frame"]]
    replay(trace, localiser, {time: (path, path) for time, path in zip(frames["time_s"], files, strict=True)})
    assert seen == [(pytest.approx(time), 128) for time in frames["time_s"]]
    readings = read_parquet(tmp_path / "localisation/sensors.parquet")[list(SENSOR_COLUMNS)]
    np.testing.assert_allclose(localiser.readings(), readings, atol=1e-12)


def test_wheels_without_slip_find_the_way_and_pictures_without_texture_do_not_harm(tmp_path):
    trace = write_drive(tmp_path, VEHICLE, ("ncl", "ncr"))
    write_estimates(tmp_path, trace, VEHICLE, ["1_hapke_0256"], seed=0)
    table = read_parquet(tmp_path / "localisation/estimates.parquet")
    assert set(zip(table["estimator"], table["pictures"], strict=True)) == {("odometry", ""), ("fused", "1_hapke_0256")}
    for _, rows in table.groupby("estimator"):
        errors = trajectory_errors(Trajectory.from_table(rows), Trajectory.from_table(trace.table))
        assert errors.path == pytest.approx(0.4)
        assert errors.end < 0.004  # 1 %


def test_the_rig_of_the_navigation_cameras_has_their_baseline_and_direction():
    calibration = calibration_of(VEHICLE, ["front_end_cam", "CamBirdViewLeft", "ncr", "ncl"], 0.25)
    assert calibration.stereo == ("ncl", "ncr")
    assert "CamBirdViewLeft" not in calibration.cameras
    rig, base_from_camera = stereo_rig(calibration, calibration.stereo)
    assert rig.baseline == pytest.approx(0.4)
    assert rig.lens.shape == (512, 512)
    np.testing.assert_allclose(base_from_camera.translation, [0.45, 0.20, 2.25])
    forward = np.cos(np.radians(20)), 0.0, -np.sin(np.radians(20))
    np.testing.assert_allclose(base_from_camera.rotate(np.array([0.0, 0, 1])), forward, atol=1e-9)
