import numpy as np
import pytest

from polarsim.geometry.lens import HALF_PIXEL
from tests.publish.tiny import KEYS

pytest.importorskip("rosbags")
pytest.importorskip("mcap_ros2")
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from polarsim.formats.ros import EXTRA_DEFINITIONS

STATION = "stations/{domain}/Terrain01_PosA"


@pytest.fixture(scope="module")
def store():
    store = get_typestore(Stores.ROS2_HUMBLE)
    types = {
        kind: fields
        for name, text in EXTRA_DEFINITIONS.items()
        for kind, fields in get_types_from_msg(text, name).items()
    }
    store.register(types)
    return store


def test_rosbags_reads_the_images_keys_labels_and_lenses_of_a_station(published, catalogue, store):
    for domain in catalogue.domains:
        found: dict[str, list] = {}
        with Reader(published("mcap") / STATION.format(domain=domain)) as reader:
            for connection, time_ns, raw in reader.messages():
                message = store.deserialize_cdr(raw, connection.msgtype)
                found.setdefault(connection.topic, []).append((time_ns, message))
            assert reader.message_count == sum(map(len, found.values())) == 17
            assert reader.duration == 10**9 + 1  # two stamps; rosbags includes the last nanosecond
        by_key = {str(one.key): one for one in catalogue.of_domain(domain)}
        for side, letter in (("left", "L"), ("right", "R")):
            keys = [message.data for _, message in found[f"/{side}/key"]]
            assert keys == [str(key) for key in sorted(KEYS) if key.camera == letter]
            for number, key in enumerate(keys):
                one = by_key[key]
                time_ns, image = found[f"/{side}/image/compressed"][number]
                assert bytes(image.data) == one.path.read_bytes()
                assert time_ns == (number + 1) * 10**9 == image.header.stamp.sec * 10**9
                _, labels = found[f"/{side}/labels"][number]
                places = [(box.bbox.center.position.x, box.bbox.center.position.y) for box in labels.detections]
                wanted = [label.box.reshape(2, 2).mean(axis=0) - HALF_PIXEL for label in catalogue.labels(one)]
                np.testing.assert_allclose(places, wanted)
                _, info = found[f"/{side}/camera_info"][number]
                matrix = catalogue.camera(one).lens.opencv_matrix()
                np.testing.assert_array_equal(np.array(info.k).reshape(3, 3), matrix)
        still = {one.child_frame_id: one.transform.translation for one in found["/tf_static"][0][1].transforms}
        sun = catalogue.terrains[1].suns["180"]
        np.testing.assert_allclose([still["sun_180"].x, still["sun_180"].y, still["sun_180"].z], sun)


def test_a_drive_is_copied_and_counted(drives_published, drive):
    folder = drives_published("mcap") / "drives/seed0"
    assert (folder / "seed0.mcap").read_bytes() == (drive / "drive.mcap").read_bytes()
    with Reader(folder) as reader:
        counts = {connection.topic: connection.msgcount for connection in reader.connections}
        assert reader.message_count == sum(counts.values())
    assert counts["/front_end_cam/image/compressed"] == 6
    assert counts["/odom"] == 101
    assert counts["/ncl/image/compressed"] == counts["/ncr/image/compressed"] == 6
    assert counts["/imu"] == counts["/wheels/speeds"] == 201


def test_rosbags_reads_the_estimates_of_the_pictures_in_the_bag(drives_published, store):
    found: dict[str, list] = {}
    with Reader(drives_published("mcap") / "drives/seed0") as reader:
        for connection, _, raw in reader.messages():
            if connection.topic.startswith("/pose/"):
                found.setdefault(connection.topic, []).append(store.deserialize_cdr(raw, connection.msgtype))
    assert {topic: len(messages) for topic, messages in found.items()} == {"/pose/odometry": 21, "/pose/fused": 21}
    assert found["/pose/odometry"][-1].pose.position.x == pytest.approx(1 - 1.02 * 0.4)
    assert found["/pose/fused"][-1].pose.position.x == pytest.approx(1 - 1.005 * 0.4)
