"""Bags are readable by the library's reader, and equal drives have equal bytes."""

import tracemalloc
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.errors import FormatError
from polarsim.rover.drive.trace import write_trace
from polarsim.rover.export.bag import grid_map, write_bag
from polarsim.rover.export.options import BagOptions
from polarsim.rover.export.replay import write_estimates
from polarsim.rover.export.sensor_messages import first_per_period
from polarsim.rover.export.sequence import write_sensors
from polarsim.rover.vehicle.table import read_vehicle
from tests.rover.drives import SPEED, straight_drive, write_drive

pytest.importorskip("mcap_ros2", reason="mcap-ros2-support is not installed")

VEHICLE = read_vehicle(Path(__file__).parents[3] / "config/viper.yaml")
VIEWS = ("front_end_cam", "CamBirdViewLeft")


@pytest.fixture(scope="module")
def drive(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("drive")
    write_drive(folder, VEHICLE, VIEWS)
    return folder


@pytest.fixture(scope="module")
def bag(drive) -> Path:
    write_bag(drive, drive / "drive.mcap", VEHICLE, BagOptions())
    return drive / "drive.mcap"


@pytest.fixture(scope="module")
def found(bag) -> dict[str, list]:
    return read(bag)


def read(path: Path) -> dict[str, list]:
    """Return the messages by topic, read by the library."""
    from mcap_ros2.reader import read_ros2_messages

    by_topic: dict[str, list] = {}
    for message in read_ros2_messages(str(path)):
        by_topic.setdefault(message.channel.topic, []).append(message)
    return by_topic


def test_all_topics_read_back(found):
    counts = {topic: len(items) for topic, items in found.items()}
    seconds, pictures = 2.0, 6  # every second of eleven picture times
    states = round(seconds * 50) + 1
    assert counts == {
        "/tf_static": 1,
        "/tf": states + pictures,  # the pose of the following camera is not part of the rover
        "/odom": states,
        "/joint_states": states,
        "/wheels/state": states,
        "/imu": 201,
        "/imu/truth": 201,
        "/wheels/speeds": 201,
        "/wheels/steering": 201,
        "/pose/odometry": round(seconds * 20) + 1,
        "/terrain/height": 2,
        **{
            f"/{view}/{topic}": pictures
            for view in VIEWS
            for topic in ("image/compressed", "camera_info", "truth", "detections")
        },
    }


def test_pictures_and_heights_are_optional(drive, tmp_path):
    write_bag(drive, tmp_path / "small.mcap", VEHICLE, BagOptions(images=False, height_hz=0))
    topics = set(read(tmp_path / "small.mcap"))
    assert not topics & {"/front_end_cam/image/compressed", "/terrain/height"}
    assert {"/front_end_cam/camera_info", "/odom"} <= topics


def test_equal_drives_have_equal_bytes(bag, drive, tmp_path):
    write_bag(drive, tmp_path / "again.mcap", VEHICLE, BagOptions())
    assert (tmp_path / "again.mcap").read_bytes() == bag.read_bytes()


def test_messages_are_in_the_order_of_their_stamps(bag):
    from mcap.reader import NonSeekingReader

    with bag.open("rb") as file:
        times = [message.log_time for _, _, message in NonSeekingReader(file).iter_messages(log_time_order=False)]
    assert times == sorted(times)
    assert times[0] == 1_000_000_000


def test_pictures_are_the_files_byte_for_byte_and_their_lens_has_the_same_scale(found, drive):
    for number, message in enumerate(found["/front_end_cam/image/compressed"]):
        assert bytes(message.ros_msg.data) == (drive / f"front_end_cam/1_hapke_0256/{2 * number:05d}.png").read_bytes()
        assert message.ros_msg.header.frame_id == "front_end_cam_optical"
    info = found["/front_end_cam/camera_info"][0].ros_msg
    assert (info.width, info.height) == (121, 76)
    assert info.k[0] == pytest.approx(2066 / 16)
    assert info.k[2] == pytest.approx(121 / 2 - 0.5)  # ROS counts from the centre of the first pixel


def test_states_are_those_of_the_drive(found):
    odometry = found["/odom"][-1].ros_msg
    assert odometry.pose.pose.position.x == pytest.approx(1 - 2 * SPEED)
    assert odometry.twist.twist.linear.x == pytest.approx(SPEED)  # forward in the base frame
    assert odometry.header.stamp.sec == 3
    wheels = found["/wheels/state"][0].ros_msg.wheels
    assert [wheel.name for wheel in wheels] == ["lf", "rf", "lr", "rr"]
    assert [wheel.contact for wheel in wheels] == [0, 1, 2, 3]
    assert wheels[2].slip == pytest.approx(0.03)
    joints = found["/joint_states"][10].ros_msg
    assert list(joints.name[:3]) == ["lf_lift", "lf_steer", "lf_spin"]
    assert joints.velocity[:3] == pytest.approx([0.01, 0.0, SPEED / 0.275])


def test_frames_chain_from_the_map_to_each_wheel(found):
    parents = {
        frame.child_frame_id: frame.header.frame_id
        for topic in ("/tf_static", "/tf")
        for message in found[topic]
        for frame in message.ros_msg.transforms
    }
    for last in ("lf_wheel", "rr_wheel", "ncl_optical", "CamBirdViewLeft_optical"):
        frame, steps = last, 0
        while frame != "map":
            frame, steps = parents[frame], steps + 1
            assert steps < 10
    assert parents["lf_wheel"] == "lf_upright"


def test_detections_and_truth_are_those_of_the_tables(found):
    truth = found["/front_end_cam/truth"]
    assert [len(message.ros_msg.detections) for message in truth] == [1] * 6
    detection = truth[0].ros_msg.detections[0]
    assert (detection.id, detection.results[0].hypothesis.class_id) == ("7", "rock")
    assert (detection.bbox.center.position.x, detection.bbox.center.position.y) == (19.5, 34.5)
    assert (detection.bbox.size_x, detection.bbox.size_y) == (20, 30)
    counts = [len(message.ros_msg.detections) for message in found["/front_end_cam/detections"]]
    assert counts == [1, 0, 1, 0, 1, 0]
    assert found["/front_end_cam/detections"][0].ros_msg.detections[0].results[0].hypothesis.score == 0.75


def test_sensors_have_the_readings_of_the_drive_and_only_the_truth_has_no_noise(found, drive):
    readings = pd.read_parquet(drive / "localisation/sensors.parquet")
    true = np.array([m.ros_msg.linear_acceleration.z for m in found["/imu/truth"]])
    assert (true == 1.62).all()
    np.testing.assert_array_equal([m.ros_msg.linear_acceleration.z for m in found["/imu"]], readings["az_m_s2"])
    sd = np.std(readings["az_m_s2"])
    assert found["/imu"][0].ros_msg.linear_acceleration_covariance[0] == pytest.approx(sd**2, rel=0.5)
    assert found["/imu"][0].ros_msg.orientation_covariance[0] == -1
    speeds, steering = (found[f"/wheels/{name}"][100].ros_msg for name in ("speeds", "steering"))
    assert list(speeds.name) == [f"{code}_spin" for code in ("lf", "rf", "lr", "rr")]
    assert speeds.velocity == pytest.approx([SPEED / 0.275] * 4, abs=0.01)  # a step of the encoder in 10 ms
    assert (len(speeds.position), len(steering.velocity)) == (0, 0)  # not measured


def test_heights_of_the_grid_map_are_at_their_positions():
    level = np.arange(12.0).reshape(3, 4)  # rows along y, columns along x
    grid = grid_map(0, level, 0.5, x0=10.0, y0=-2.0)
    position, data = grid["info"]["pose"]["position"], grid["data"][0]["data"]
    rows = grid["data"][0]["layout"]["dim"][1]["size"]
    for i in range(4):  # grid_map: row i towards -x, column j towards -y, from the corner of maximum x and y
        for j in range(3):
            x = position["x"] + grid["info"]["length_x"] / 2 - 0.5 * (i + 0.5)
            y = position["y"] + grid["info"]["length_y"] / 2 - 0.5 * (j + 0.5)
            assert data[j * rows + i] == level[round((y + 2) / 0.5), round((x - 10) / 0.5)]


def test_the_error_of_a_picture_of_another_shape_has_its_path(tmp_path):
    from polarsim.formats import png

    write_drive(tmp_path, VEHICLE)
    png.write_png(tmp_path / "front_end_cam/1_hapke_0256/00004.png", np.zeros((50, 121), np.uint16))
    png.write_png(tmp_path / "front_end_cam/1_hapke_0256/00000.png", np.zeros((50, 121), np.uint16))
    with pytest.raises(FormatError, match=r"00000\.png"):
        write_bag(tmp_path, tmp_path / "drive.mcap", VEHICLE, BagOptions())
    assert not list(tmp_path.glob("*.mcap"))


def test_memory_does_not_grow_with_the_drive(tmp_path):
    peaks = []
    for seconds in (1.0, 2.5):
        folder = tmp_path / str(seconds)
        trace = straight_drive(seconds, log_hz=5, picture_hz=10)
        write_trace(folder, trace)
        write_sensors(folder, trace, VEHICLE, (), 1.0, seed=0)
        write_estimates(folder, trace, VEHICLE, (), seed=0)
        tracemalloc.start()
        write_bag(folder, folder / "drive.mcap", VEHICLE, BagOptions(height_hz=10))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < peaks[0] + 0.75e6  # bytes; the additional messages have 1.5e6


@given(st.floats(1, 200), st.floats(1, 200), st.integers(2, 400))
def test_the_selected_times_have_the_given_rate(log_hz, hz, count):
    times = np.arange(count) / log_hz
    chosen = first_per_period(times, hz)
    assert chosen[0] == 0
    assert abs(len(chosen) - min(count, times[-1] * hz + 1)) <= 1 + 1e-6 * count
