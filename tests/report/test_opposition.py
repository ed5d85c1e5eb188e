import json

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.formats import png
from polarsim.formats.tables import write_parquet
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose, camera_pose
from polarsim.geometry.stereo import StereoRig
from polarsim.photo import BLACK_LEVEL, PhotoKey
from polarsim.report.figures.opposition import draw_opposition, extreme_spots, lit_by_single_lamp, phase_angles
from polarsim.run_files.lamps import write_suns
from polarsim.run_files.rigs import LocalisedRig, write_localised
from polarsim.site import polar
from tests.support.polar_photos import HEIGHT, WIDTH

EYE = np.array([3.5, 0.0, 1.5])
HALF = np.array([2.0, 2.0])  # half widths of the sandbox, metres
NARROW = 640  # px
SUN_ONLY, BOTH, ROVER = (PhotoKey.parse(f"01_A_{name}_L_0256") for name in ("off_30", "on_30", "on_no"))


@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(0.1, 5))
def test_a_lamp_on_the_line_of_sight_has_phase_angle_0(x, y, behind):
    """The lamp is behind the camera on the line through (x, y, 0) and the camera."""
    ground = np.array([x, y, 0.0])
    lamp = EYE + behind * (EYE - ground)
    camera = Pose(np.eye(3), EYE)
    np.testing.assert_allclose(phase_angles(camera, ground - EYE, lamp, HALF), 0, atol=1e-7)


def test_a_lamp_at_a_right_angle_has_phase_angle_90_degrees():
    camera = Pose(np.eye(3), np.array([1.0, 0.0, 1.0]))
    angle = phase_angles(camera, np.array([-1.0, 0.0, -1.0]), np.array([-1.0, 0.0, 1.0]), HALF)
    np.testing.assert_allclose(angle, np.pi / 2)


def test_points_near_the_walls_or_above_the_horizon_have_no_phase_angle():
    camera = Pose(np.eye(3), EYE)
    rays = np.array([[0.0, 0.0, 1.0], [-5.2, 0.0, -1.5], [-1.0, 0.0, 0.0]])
    assert np.isnan(phase_angles(camera, rays, EYE, HALF)).all()


def test_only_photos_with_a_single_lamp_have_a_phase_angle():
    assert [lit_by_single_lamp(key) for key in (SUN_ONLY, BOTH, ROVER)] == [True, False, True]
    assert not lit_by_single_lamp(PhotoKey.parse("01_A_off_no_L_0256"))


@pytest.fixture
def cameras(tmp_path):
    lens = Lens(2066.0, 2066.0, WIDTH / 2, HEIGHT / 2, width=WIDTH, height=HEIGHT)
    apart = Pose(np.eye(3), np.array([0.3, 0.0, 0.0]))
    rig = LocalisedRig(StereoRig(lens, lens, apart), camera_pose(EYE, np.pi, np.radians(25)))
    write_localised(tmp_path / "cameras" / "PosA.json", rig)
    write_suns(tmp_path / "cameras", {"30": np.array([-3.5, 0.0, 0.8])})
    return tmp_path / "cameras"


def test_the_rover_light_is_nearer_to_opposition_than_a_lamp_across(cameras):
    near, far = extreme_spots(polar(), 1, [SUN_ONLY, BOTH, ROVER], cameras, 140)
    assert (near.key, far.key) == (ROVER, SUN_ONLY)
    # The light is 0.15 m from the camera and the ground at 3 to 5 m: 1.7 to 2.9 degrees.
    assert 1.5 < near.phase_deg < 3
    assert far.phase_deg > 120
    assert extreme_spots(polar(), 1, [BOTH], cameras, 140) is None


def draw(tmp_path, cameras, keys, brightness):
    photos = [{"key": str(key), "path": str(tmp_path / f"analog/Terrain01/{key}.png")} for key in keys]
    write_parquet(tmp_path / "photos.parquet", pd.DataFrame(photos))
    for domain, grey in brightness.items():
        for key in keys:
            pixels = np.full((HEIGHT, WIDTH), BLACK_LEVEL + grey, np.uint16)
            png.write_png(tmp_path / domain / "Terrain01" / f"{key}.png", pixels)
    draw_opposition(
        site=polar(),
        keys=keys,
        cameras={1: cameras},
        photo_domain="analog",
        models=["hapke"],
        pictures=[tmp_path / "photos.parquet", tmp_path / "hapke/Terrain01"],
        figure=tmp_path / "o.png",
        text=tmp_path / "o.json",
        width=NARROW,
    )
    return json.loads((tmp_path / "o.json").read_text())


def test_the_caption_has_the_brightness_ratio_at_both_phase_angles(tmp_path, cameras):
    caption = draw(tmp_path, cameras, [SUN_ONLY, ROVER], {"analog": 800, "hapke": 1600})
    assert caption["shown"]
    assert caption["text"].count("2.00 (Hapke)") == 2
    assert str(ROVER) in caption["text"].split(". ")[0]
    assert "changes by a factor of 1 (Hapke)" in caption["text"]  # the same ratio at both angles
    shown = png.read_png(tmp_path / "o.png")
    assert shown.shape[1] == 640
    photo, twin = (
        np.median(shown[120:160, at : at + 40]) for at in (150, 460)
    )  # both with the white level of the twin
    assert twin == 255
    assert photo == pytest.approx(255 * 0.5 ** (1 / 2.2), abs=2)


def test_clipped_crops_are_not_compared(tmp_path, cameras):
    caption = draw(tmp_path, cameras, [ROVER], {"analog": 800, "hapke": 4079})
    assert "Hapke is clipped" in caption["text"]


@pytest.mark.parametrize(("key", "reason"), [(SUN_ONLY, "smallest phase angle"), (BOTH, "single lamp")])
def test_a_run_without_opposition_gives_the_reason(tmp_path, cameras, key, reason):
    caption = draw(tmp_path, cameras, [key], {"analog": 800, "hapke": 800})
    assert not caption["shown"]
    assert reason in caption["text"]
