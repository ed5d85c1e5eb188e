"""Check of a calibration against photos: rendered images of a textured plane from the stated rig."""

import logging
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest

from polarsim.acquire import stereo_check
from polarsim.acquire.stereo_check import check_calibration
from polarsim.errors import FormatError
from polarsim.formats import png
from polarsim.geometry.poses import Pose
from polarsim.geometry.stereo import StereoRig
from polarsim.photo import PhotoKey
from tests.support.polar_photos import HEIGHT, WIDTH
from tests.support.polar_rig import default_rig

LEFT = PhotoKey.parse("03_A_off_30_L_0256")
RIG = default_rig()
STEP = 8  # px between pixels whose rays are computed
EXCHANGED = StereoRig(RIG.left, RIG.right, Pose(RIG.left_from_right.rotation, -RIG.left_from_right.translation))


def rendered(lens, left_from_camera):
    """Render a plane 3 m in front of the left camera with blurred noise as texture."""
    texture = cv2.GaussianBlur(np.random.default_rng(0).uniform(0, 4000, (1000, 1400)).astype(np.float32), (0, 0), 4)
    texture = np.clip((texture - 2000) * 8 + 2000, 16, 4095)
    rows, columns = (np.mgrid[0 : HEIGHT // STEP, 0 : WIDTH // STEP] + 0.5) * STEP
    directions = left_from_camera.rotate(lens.directions(np.stack([columns, rows], -1)))
    origin = left_from_camera.translation
    points = origin + directions * ((3.0 - origin[2]) / directions[..., 2:])
    coarse = (((points[..., k] + shift) * 300).astype(np.float32) for k, shift in ((0, 2.3), (1, 1.6)))
    u, v = (cv2.resize(part, (WIDTH, HEIGHT), interpolation=cv2.INTER_LINEAR) for part in coarse)
    return cv2.remap(texture, u, v, cv2.INTER_LINEAR).astype(np.uint16)


@pytest.fixture(scope="module", autouse=True)
def _cached_matches():
    """Match the features of each pair once, which takes seconds."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stereo_check, "_matched_pixels", cache(stereo_check._matched_pixels))
        yield


@pytest.fixture(scope="module")
def photos(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pair")
    paths = {LEFT: folder / "left.png", LEFT.other_camera: folder / "right.png"}
    png.write_png(paths[LEFT], rendered(RIG.left, Pose.identity()))
    png.write_png(paths[LEFT.other_camera], rendered(RIG.right, RIG.left_from_right))
    return paths


def test_the_calibration_of_the_photos_passes(photos, tmp_path):
    check_calibration(photos, RIG, tmp_path / "stereo.calibration", 256)


@pytest.mark.parametrize(
    "rig",
    [
        EXCHANGED,
        StereoRig(RIG.right, RIG.left, RIG.left_from_right),
        StereoRig(RIG.left.scaled(0.5), RIG.right.scaled(0.5), RIG.left_from_right),
        replace(RIG, left_from_right=Pose.from_rotvec(np.array([0.01, 0, 0]), RIG.left_from_right.translation)),
    ],
    ids=["sign of the baseline", "lenses exchanged", "half size", "tilted by 0.6 degrees"],
)
def test_a_wrong_calibration_is_an_error_with_the_file(photos, tmp_path, rig):
    with pytest.raises(FormatError) as caught:
        check_calibration(photos, rig, tmp_path / "stereo.calibration", 256)
    assert caught.value.path == tmp_path / "stereo.calibration"


def test_exchanged_photos_are_an_error(photos, tmp_path):
    exchanged = {LEFT: photos[LEFT.other_camera], LEFT.other_camera: photos[LEFT]}
    with pytest.raises(FormatError):
        check_calibration(exchanged, RIG, tmp_path / "stereo.calibration", 256)
    with pytest.raises(FormatError):
        check_calibration(exchanged, RIG, None, 256)


def test_the_stated_calibration_causes_a_warning_instead_of_an_error(photos, caplog):
    with caplog.at_level(logging.WARNING):
        check_calibration(photos, replace(RIG, left=RIG.right, right=RIG.left), None, 256)
    assert len(caplog.records) == 1


def test_photos_without_features_or_without_a_pair_are_not_checked(photos, tmp_path):
    check_calibration({LEFT: photos[LEFT]}, EXCHANGED, tmp_path, 256)
    png.write_png(tmp_path / "black.png", np.full((HEIGHT, WIDTH), 16, np.uint16))
    check_calibration(dict.fromkeys((LEFT, LEFT.other_camera), tmp_path / "black.png"), EXCHANGED, tmp_path, 256)
