import numpy as np
import pandas as pd
import pytest
import yaml

from polarsim.formats import png
from polarsim.formats.tables import read_parquet
from tests.rover.drives import RADIUS

pytest.importorskip("evo")
from evo.core import metrics, sync
from evo.tools import file_interface

NAME = "seed0_1_hapke_0256"


def test_evo_reads_euroc_states_and_stamps(drives_published, drive):
    folder = drives_published("euroc") / NAME / "mav0"
    found = file_interface.read_euroc_csv_trajectory(folder / "state_groundtruth_estimate0/data.csv")
    table = read_parquet(drive / "trace.parquet")
    np.testing.assert_allclose(found.timestamps, table["time_s"] + 1, atol=1e-9, rtol=0)
    np.testing.assert_allclose(found.positions_xyz, table[["x_m", "y_m", "z_m"]], atol=1e-12)
    np.testing.assert_allclose(found.orientations_quat_wxyz, table[["qw", "qx", "qy", "qz"]], atol=1e-12)
    assert found.check()[0]


def mount(sensor: dict) -> np.ndarray:
    return np.array(sensor["T_BS"]["data"]).reshape(sensor["T_BS"]["rows"], sensor["T_BS"]["cols"])


def test_readings_of_imu_and_wheels_are_those_of_the_drive(drives_published, drive):
    folder = drives_published("euroc") / NAME / "mav0"
    readings = read_parquet(drive / "localisation/sensors.parquet")
    imu, wheels = (np.loadtxt(folder / name / "data.csv", delimiter=",") for name in ("imu0", "wheels0"))
    names = ["gx_rad_s", "gy_rad_s", "gz_rad_s", "ax_m_s2", "ay_m_s2", "az_m_s2"]
    np.testing.assert_array_equal(imu[:, 1:], readings[names])
    np.testing.assert_array_equal(wheels[:, 4], readings["rr_spin_rad_s"])
    noise = yaml.safe_load((folder / "imu0/sensor.yaml").read_text())["gyroscope_noise_density"]
    assert np.std(imu[:, 3]) == pytest.approx(noise * 10, rel=0.25)  # 100 readings per second, 201 in all
    stated = yaml.safe_load((folder / "wheels0/sensor.yaml").read_text())["wheels"]
    assert np.mean(wheels[1:, 1]) * stated["lf"]["radius_m"] == pytest.approx(0.2, abs=1e-4)  # m/s


def test_the_first_two_cameras_are_the_stereo_pair_with_its_calibration(drives_published):
    folder = drives_published("euroc") / NAME / "mav0"
    left, right = (yaml.safe_load((folder / name / "sensor.yaml").read_text()) for name in ("cam0", "cam1"))
    np.testing.assert_allclose((np.linalg.inv(mount(left)) @ mount(right))[:3, 3], [0.4, 0, 0], atol=1e-12)
    assert left["intrinsics"] == right["intrinsics"]
    assert left["resolution"] == [128, 128]
    focal = 64 / np.tan(np.radians(35))  # field of view of 70 degrees
    np.testing.assert_allclose(left["intrinsics"], [focal, focal, 63.5, 63.5])  # OpenCV counts from pixel centres
    assert left["rate_hz"] == pytest.approx(2.5)


@pytest.mark.parametrize(("estimator", "share"), [("odometry", 0.02), ("fused", 0.005)])
def test_evo_computes_the_errors_of_the_baselines(drives_published, estimator, share):
    for form, estimate, truth in (
        ("euroc", f"{NAME}/estimates/{estimator}.txt", f"{NAME}/mav0/state_groundtruth_estimate0/data.csv"),
        ("tum", f"{NAME}/ncl/{estimator}.txt", f"{NAME}/ncl/groundtruth.txt"),
    ):
        folder = drives_published(form)
        read = file_interface.read_euroc_csv_trajectory if form == "euroc" else file_interface.read_tum_trajectory_file
        paths = read(folder / truth), file_interface.read_tum_trajectory_file(folder / estimate)
        error = metrics.APE(metrics.PoseRelation.translation_part)
        error.process_data(sync.associate_trajectories(*paths))
        table = pd.read_csv(folder / "baselines.csv").set_index(["sequence", "estimator"])
        assert table.index.is_unique
        row = table.loc[(NAME, estimator)]
        assert row["path_m"] == pytest.approx(0.4)  # 2 s at 0.2 m/s
        assert row["end_percent"] == pytest.approx(100 * share, rel=1e-3)
        assert row["rms_m"] == pytest.approx(error.get_statistic(metrics.StatisticsType.rmse), rel=1e-4)


def test_euroc_cameras_have_images_with_stamps_and_a_mount(drives_published, drive):
    folder = drives_published("euroc") / NAME / "mav0"
    lines = (folder / "cam2/data.csv").read_text().splitlines()[1:]
    frames = read_parquet(drive / "front_end_cam/poses.parquet")
    assert [line.split(",")[0] for line in lines] == [str(10**9 + round(time * 1e9)) for time in frames["time_s"]]
    for line, frame in zip(lines, frames["frame"], strict=True):
        own = png.read_png(folder / "cam2/data" / line.split(",")[1])
        np.testing.assert_array_equal(own, png.read_png(drive / f"front_end_cam/1_hapke_0256/{frame:05d}.png"))
    base_from_camera = mount(yaml.safe_load((folder / "cam2/sensor.yaml").read_text()))
    row = frames.iloc[0]
    # Initial pose of the rover: position (1, 0, RADIUS), heading west (180 degrees about z).
    world_from_base = np.array([[-1.0, 0, 0, 1], [0, -1, 0, 0], [0, 0, 1, RADIUS], [0, 0, 0, 1]])
    np.testing.assert_allclose((world_from_base @ base_from_camera)[:3, 3], row[["x_m", "y_m", "z_m"]], atol=1e-9)


def test_evo_reads_tum_camera_poses_without_error(drives_published, drive):
    folder = drives_published("tum") / NAME / "front_end_cam"
    truth = file_interface.read_tum_trajectory_file(folder / "groundtruth.txt")
    frames = read_parquet(drive / "front_end_cam/poses.parquet")
    at = [int(np.abs(truth.timestamps - time - 1).argmin()) for time in frames["time_s"]]
    np.testing.assert_allclose(truth.timestamps[at], frames["time_s"] + 1, atol=1e-6)
    np.testing.assert_allclose(truth.positions_xyz[at], frames[["x_m", "y_m", "z_m"]], atol=1e-9)
    error = metrics.APE(metrics.PoseRelation.full_transformation)
    error.process_data((truth, file_interface.read_tum_trajectory_file(folder / "groundtruth.txt")))
    assert error.get_statistic(metrics.StatisticsType.max) < 1e-9
    pictures = [line.split()[1] for line in (folder / "rgb.txt").read_text().splitlines()[1:]]
    assert len(pictures) == 6
    assert all((folder / name).is_file() for name in pictures)
