import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from polarsim.detect.options import PicturesOptions
from polarsim.detect.tone import bits_in_use, brightened, shrink, to_8_bits
from polarsim.errors import DetectError

RAMP = np.linspace(16, 4095, 4080).round().astype(np.uint16)[None].repeat(4, axis=0)


def test_the_linear_curve_maps_the_sensors_range():
    picture = to_8_bits(np.array([[0, 16, 4095, 16 + (4095 - 16) // 2]], np.uint16), PicturesOptions(tone="linear"))
    np.testing.assert_array_equal(picture, [[0, 0, 255, 127]])


def test_the_percentile_becomes_white_and_black_stays_black():
    dim = (16 + (RAMP - 16) / 8).astype(np.uint16)  # an eighth of the exposure
    options = PicturesOptions(tone="percentile", tone_percentile=90)
    picture = to_8_bits(dim, options)
    assert picture[0, 0] == 0
    assert abs(np.mean(picture == 255) - 0.1) < 0.01


def test_the_gamma_curve_is_the_stretched_one_to_the_power_of_1_over_2_2():
    stretched = to_8_bits(RAMP, PicturesOptions(tone="percentile")) / 255
    shades = stretched > 0.05  # below, the eight bits of the stretched picture are too coarse to compare with
    curved = to_8_bits(RAMP, PicturesOptions(tone="gamma")) / 255
    np.testing.assert_allclose(curved[shades], stretched[shades] ** (1 / 2.2), atol=0.01)


def test_a_shorter_exposure_gives_the_same_picture_where_nothing_clips():
    long, short = RAMP, (16 + (RAMP - 16) / 4).astype(np.uint16)
    difference = to_8_bits(long, PicturesOptions()).astype(int) - to_8_bits(short, PicturesOptions())
    assert np.abs(difference[:, 200:]).max() <= 2  # quantisation of the short one


def test_noise_of_a_dark_photo_is_not_stretched(rng):
    dark = rng.integers(14, 19, (50, 60)).astype(np.uint16)
    assert to_8_bits(dark, PicturesOptions(tone="percentile", tone_floor_dn=100)).max() <= 5  # 2 of 100 DN


FIXED = PicturesOptions(tone="fixed", tone_exposure_ms=256)


def test_the_fixed_curve_is_the_linear_one_to_the_power_of_1_over_2_2_at_its_own_exposure():
    linear = to_8_bits(RAMP, PicturesOptions(tone="linear")) / 255
    shades = linear > 0.05
    np.testing.assert_allclose(to_8_bits(RAMP, FIXED, 256)[shades] / 255, linear[shades] ** (1 / 2.2), atol=0.01)


@settings(deadline=None)
@given(st.integers(0, 4079), st.sampled_from([16, 64, 512, 2048]))
def test_the_fixed_curve_shows_one_scene_alike_at_every_exposure(light, exposure_ms):
    at_256 = light * 256 / exposure_ms  # of a scene whose picture has this light, DN
    assume(at_256 < 4079)
    shown = [
        to_8_bits(np.array([[16 + value]]), FIXED, ms)[0, 0] for value, ms in ((light, exposure_ms), (at_256, 256))
    ]
    assert shown[0] == shown[1]


def test_the_fixed_curve_needs_an_exposure():
    with pytest.raises(DetectError, match="needs the picture's exposure"):
        to_8_bits(RAMP, FIXED)


def test_shrinking_averages_light():
    checks = np.tile(np.array([[0, 4000], [4000, 0]], np.uint16), (20, 30))  # 60 x 40
    small = shrink(checks, 30)
    assert small.shape == (20, 30)
    np.testing.assert_allclose(small, 2000)


@pytest.mark.parametrize(("kind", "most", "bits"), [("u1", 255, 8), ("u2", 0, 12), ("u2", 4095, 12), ("u2", 4096, 16)])
def test_a_picture_has_as_many_bits_as_its_brightest_pixel_asks_for(kind, most, bits):
    picture = np.array([[0, most]], kind)
    assert bits_in_use(picture, picture.dtype) == bits
    assert bits_in_use(picture[:, :0], picture.dtype) in (8, 12)


def test_underexposed_pictures_of_eight_bits_become_as_bright_as_others():
    ramp = np.tile(np.arange(256, dtype=np.uint8), (64, 1))
    np.testing.assert_array_equal(brightened(ramp, PicturesOptions()), ramp)
    np.testing.assert_allclose(brightened(ramp // 4, PicturesOptions()), ramp, atol=5)
    assert brightened(ramp // 64, PicturesOptions()).max() == 8 * 3  # what is that dark is noise
    assert not brightened(np.zeros((8, 8), np.uint8), PicturesOptions()).any()
