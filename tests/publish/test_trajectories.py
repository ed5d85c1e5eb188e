import numpy as np
import pytest
import yaml

from polarsim.formats import png
from polarsim.formats.tables import read_parquet

pytest.importorskip("evo")
from evo.core import metrics
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
    imu = np.loadtxt(folder / "imu0/data.csv", delimiter=",")
    np.testing.assert_array_equal(imu[:, 6], table["az_m_s2"])


def test_euroc_cameras_have_images_with_stamps_and_a_mount(drives_published, drive):
    folder = drives_published("euroc") / NAME / "mav0"
    lines = (folder / "cam0/data.csv").read_text().splitlines()[1:]
    frames = read_parquet(drive / "front_end_cam/poses.parquet")
    assert [line.split(",")[0] for line in lines] == [str(10**9 + round(time * 1e9)) for time in frames["time_s"]]
    for line, frame in zip(lines, frames["frame"], strict=True):
        own = png.read_png(folder / "cam0/data" / line.split(",")[1])
        np.testing.assert_array_equal(own, png.read_png(drive / f"front_end_cam/1_hapke_0256/{frame:05d}.png"))
    stated = yaml.safe_load((folder / "cam0/sensor.yaml").read_text())["T_BS"]
    base_from_camera = np.array(stated["data"]).reshape(stated["rows"], stated["cols"])
    row = frames.iloc[0]
    # Initial pose of the rover: position (1, 0, 0.25), heading west (180 degrees about z).
    world_from_base = np.array([[-1.0, 0, 0, 1], [0, -1, 0, 0], [0, 0, 1, 0.25], [0, 0, 0, 1]])
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
