import numpy as np
import pytest

from polarsim.analog.light import DiscLamp
from polarsim.analog.sensor import blur_and_vignette, expose_raw, lamp_glare
from polarsim.geometry.camera import Camera
from polarsim.geometry.poses import camera_pose
from polarsim.photo_format import in_photo_format
from polarsim.site import polar
from polarsim.site_parts import Images
from tests.support.polar_rig import default_rig

FORM = polar().images
FLAT = np.ones((300, 300), np.float32)


def shoot(level, exposure_ms, seed=1, form=FORM):
    return expose_raw(level * FLAT, exposure_ms, 1.0, np.random.default_rng(seed), FLAT, form)


def test_a_dark_photo_has_the_black_level_and_the_read_noise():
    photo = shoot(0.0, 100).astype(float)
    assert photo.mean() == pytest.approx(16, abs=0.02)
    assert photo.std() == pytest.approx(np.hypot(7 / 8, np.sqrt(1 / 12)), rel=0.02)  # read noise and rounding


@pytest.mark.parametrize("electrons", [800, 8000, 24000])
def test_noise_grows_with_the_root_of_the_light(electrons):
    photo = shoot(electrons / 128, 128).astype(float)
    assert photo.mean() - 16 == pytest.approx(electrons / 8, rel=0.005)
    assert photo.var() == pytest.approx((electrons + 49) / 64 + 1 / 12, rel=0.05)  # photon transfer curve


def test_values_are_proportional_to_exposure_until_they_clip_at_twelve_bits():
    half, full, far = (shoot(20.0, exposure).astype(float).mean() - 16 for exposure in (512, 1024, 8192))
    assert full == pytest.approx(2 * half, rel=0.01)
    assert far == 4095 - 16
    assert shoot(20.0, 8192).dtype == np.uint16


def test_the_lens_darkens_corners_and_spreads_bright_light():
    image = np.full((400, 640), 0.01, np.float32)
    image[180:220, 300:340] = 100
    seen = blur_and_vignette(image)
    assert seen[2, 2] < 0.85 * seen[2, 320]  # vignetting
    assert seen[200, 400] > 1.05 * blur_and_vignette(np.full_like(image, 0.01))[200, 400]  # glare


def test_glare_of_a_visible_lamp_is_maximal_at_the_lamp_and_zero_for_a_lamp_behind_the_camera():
    lens = default_rig().left
    pose = camera_pose(np.array([3.5, 0.0, 1.5]), np.pi, np.radians(20))
    lamp, behind = (DiscLamp(np.array([x, 0.5, 0.75]), np.zeros(3), 0.045) for x in (-3.5, 8.5))
    glare, none = (lamp_glare(each, Camera(pose, lens), 0.002, np.random.default_rng(1)) for each in (lamp, behind))
    row, column = np.unravel_index(np.argmax(glare), glare.shape)
    expected = lens.project(pose.inverse().apply(lamp.position))
    assert np.hypot(column - expected[0], row - expected[1]) < 20
    assert not none.any()


@pytest.mark.parametrize(("bits", "black", "white"), [(8, 2, None), (14, 64, 16000), (12, 16, None)])
def test_photos_of_other_bits_agree_in_polarsims_photo_format(bits, black, white):
    form = Images(width=300, height=300, bits=bits, black=black, white=white)
    step = (4095 - 16) / (form.white_level - black)
    for exposure in (64, 512, 8192):
        values = shoot(20.0, exposure, form=form)
        assert values.max() <= form.white_level
        usual, converted = shoot(20.0, exposure).astype(float), in_photo_format(values, form).astype(float)
        assert np.abs(converted - usual).max() <= step / 2 + 1  # rounding
        assert converted.mean() == pytest.approx(usual.mean(), abs=0.1 * step)
