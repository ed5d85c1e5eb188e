"""Finds off the sandbox's sand are left out where the camera's pose is known."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.detect.on_sand import MARGIN_M, Sand, on_sand
from polarsim.errors import DetectError
from polarsim.formats.rigs import LocalisedRig, write_localised
from polarsim.geometry.poses import looking
from polarsim.geometry.stereo import stated_rig
from polarsim.survey import SANDBOX_HALF_WIDTH

KEY = "01_A_off_30_L_0256"
RIG = LocalisedRig(stated_rig(), looking(np.array([-3.2, 0.0, 1.0]), 0.0, np.radians(12)), "labels")
CAMERA = RIG.camera("L")
SIDE_PX = 40.0


def standing_at(x, y, kind=0):
    """(1, 6) box of a rock whose lower side's middle, or of a shadow whose centre, lies at a point of the sand."""
    (u, v) = CAMERA.project(np.array([x, y, 0.0]))
    low = v if kind == 0 else v + SIDE_PX / 2
    return np.array([[u - SIDE_PX / 2, low - SIDE_PX, u + SIDE_PX / 2, low, 0.9, kind]])


@given(st.floats(-1.1, 4), st.floats(-1, 1), st.sampled_from([0, 1]))
def test_a_box_is_on_the_sand_where_its_foot_is(x, y, kind):
    edge = SANDBOX_HALF_WIDTH + MARGIN_M
    if abs(x - edge) > 1e-6:
        assert on_sand(standing_at(x, y, kind), CAMERA, 0.0).tolist() == [x < edge]


def test_nothing_above_the_horizon_is_on_the_sand():
    sky = np.array([[900.0, -40, 940, 0.5, 0.9, 0]])
    assert CAMERA.directions(np.array([920.0, 0.5]))[2] > 0
    assert not on_sand(sky, CAMERA, 0.0)[0]


def test_higher_sand_reaches_less_far_up_in_the_photo():
    wall = standing_at(2.3, 0.0)
    assert not on_sand(wall, CAMERA, 0.0)[0]
    assert on_sand(wall, CAMERA, 0.2)[0]


@pytest.mark.parametrize(
    ("rigs", "kept"),
    [({"A": RIG}, 1), ({"B": RIG}, 2), ({"A": replace(RIG, method="survey")}, 2), ({}, 2)],
    ids=["known", "other position", "surveyed alone", "none"],
)
def test_photos_without_a_pose_keep_all(rigs, kept, tmp_path):
    folder = tmp_path / "Terrain01"
    folder.mkdir()
    for position, rig in rigs.items():
        write_localised(folder / f"Pos{position}.json", rig)
    found = np.concatenate([standing_at(0, 0), standing_at(3, 0)])
    assert len(Sand.read([folder]).keep(KEY, found)) == kept
    assert len(Sand.read([folder]).keep("03" + KEY[2:], found)) == 2


def test_a_folder_of_another_name_is_refused(tmp_path):
    with pytest.raises(DetectError, match="not named TerrainTT"):
        Sand.read([tmp_path])
