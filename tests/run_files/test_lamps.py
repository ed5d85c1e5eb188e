import numpy as np
import pytest

from polarsim.errors import FormatError
from polarsim.geometry.poses import Pose
from polarsim.run_files import lamps
from polarsim.run_files.rigs import LocalisedRig
from polarsim.site import polar
from tests.support.polar_rig import default_rig
from tests.support.polar_survey import SURVEYED_LEFT, lamp_position

LIFT = np.array([0.0, 0.0, 0.18])
RIGS = {
    position: LocalisedRig(default_rig(), Pose(np.eye(3), point + LIFT)) for position, point in SURVEYED_LEFT.items()
}


def test_lamps_that_are_not_localised_have_surveyed_positions_at_the_height_of_the_rigs(tmp_path):
    suns = lamps.read_suns(tmp_path, RIGS, polar(), 1)
    assert sorted(suns) == ["180", "270", "30", "350"]
    np.testing.assert_allclose(suns["180"], lamp_position("180") + LIFT, atol=1e-12)


def test_cameras_of_another_sandbox_do_not_affect_the_height_of_the_survey(tmp_path):
    beside = {
        position: LocalisedRig(default_rig(), Pose(np.eye(3), np.array([2.0, -0.15, 1.25]))) for position in "ABCDEFG"
    }
    np.testing.assert_array_equal(lamps.read_suns(tmp_path, beside, polar(), 13)["30"], lamp_position("30"))
    one_there = beside | {"A": RIGS["A"]}
    lift = RIGS["A"].sandbox_from_left.translation[2] - np.median([point[2] for point in SURVEYED_LEFT.values()])
    np.testing.assert_allclose(lamps.read_suns(tmp_path, one_there, polar(), 1)["30"], lamp_position("30", lift))


def test_localised_lamps_replace_surveyed_lamps(tmp_path):
    lamps.write_suns(tmp_path, {"30": np.array([3.51234, 1.3, 0.8])})
    suns = lamps.read_suns(tmp_path, RIGS, polar(), 1)
    np.testing.assert_array_equal(suns["30"], [3.5123, 1.3, 0.8])
    np.testing.assert_allclose(suns["270"], lamp_position("270") + LIFT, atol=1e-12)


@pytest.mark.parametrize("text", ["[1, 2]", '{"40": [1, 2, 3]}', '{"30": [1, 2]}', '{"30": ["x", 1, 2]}', "{"])
def test_an_invalid_file_is_an_error(tmp_path, text):
    (tmp_path / lamps.FILE).write_text(text)
    with pytest.raises(FormatError, match=r"lamps\.json"):
        lamps.read_suns(tmp_path, RIGS, polar(), 1)


def test_the_file_has_only_localised_lamps(tmp_path):
    assert lamps.read_localised_suns(tmp_path) == {}
    lamps.write_suns(tmp_path, {"180": np.array([-3.5, 0.4, 0.8])})
    assert list(lamps.read_localised_suns(tmp_path)) == ["180"]
