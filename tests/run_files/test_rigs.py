import json

import numpy as np
import pytest

from polarsim.errors import FormatError
from polarsim.geometry.poses import Pose, camera_pose
from polarsim.run_files.rigs import (
    LocalisedRig,
    read_localised,
    read_rig,
    write_localised,
    write_rig,
)
from tests.support.polar_rig import default_rig

SANDBOX_FROM_LEFT = camera_pose(np.array([3.6, -0.4, 1.5]), 3.1, 0.44, -0.01)
LOCALISED = LocalisedRig(default_rig(), SANDBOX_FROM_LEFT, "labels", {"sd_mm": 12.5})


def test_a_localised_rig_reads_back(tmp_path):
    write_localised(tmp_path / "PosA.json", LOCALISED)
    back = read_localised(tmp_path / "PosA.json")
    np.testing.assert_allclose(back.sandbox_from_left.matrix, SANDBOX_FROM_LEFT.matrix, atol=1e-15)
    assert back.rig.left == LOCALISED.rig.left
    assert (back.method, back.metrics) == ("labels", {"sd_mm": 12.5})


def test_a_calibration_reads_back(tmp_path):
    write_rig(tmp_path / "calibration.json", default_rig(), "stated")
    back = read_rig(tmp_path / "calibration.json")
    assert back.right == default_rig().right
    np.testing.assert_allclose(back.left_from_right.matrix, default_rig().left_from_right.matrix, atol=1e-15)


def test_the_right_camera_is_a_baseline_to_the_right_of_the_left_camera():
    centre = LOCALISED.sandbox_from("R").translation
    assert np.linalg.norm(centre - SANDBOX_FROM_LEFT.translation) == pytest.approx(
        0.30156, abs=1e-4
    )  # length of T in the calibration
    # The camera at A faces -X, so that right is +Y.
    assert centre[1] - SANDBOX_FROM_LEFT.translation[1] == pytest.approx(0.30, abs=0.02)


@pytest.mark.parametrize("key", ["left", "right", "left_from_right", "sandbox_from_left"])
def test_a_missing_key_is_an_error_with_the_file(tmp_path, key):
    path = tmp_path / "PosA.json"
    write_localised(path, LOCALISED)
    content = json.loads(path.read_text())
    del content[key]
    path.write_text(json.dumps(content))
    with pytest.raises(FormatError, match=rf"PosA\.json: .*{key}"):
        read_localised(path)


@pytest.mark.parametrize("rotation", [np.diag([1.0, 1, 1.01]), np.diag([1.0, 1, -1]), np.full((3, 3), np.nan)])
def test_an_invalid_rotation_is_an_error(tmp_path, rotation):
    path = tmp_path / "PosA.json"
    write_localised(path, LocalisedRig(default_rig(), Pose(np.eye(3), np.zeros(3))))
    content = json.loads(path.read_text())
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    content["sandbox_from_left"] = matrix.tolist()
    path.write_text(json.dumps(content))
    with pytest.raises(FormatError, match=r"PosA\.json"):
        read_localised(path)
