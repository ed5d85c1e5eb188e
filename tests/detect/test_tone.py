import numpy as np
import pytest

from polarsim.detect.tone import bits_in_use, brighten, shrink, to_8_bits

RAMP = np.linspace(16, 4095, 4080).round().astype(np.uint16)[None].repeat(4, axis=0)


def test_the_percentile_becomes_white_and_black_stays_black():
    dim = (16 + (RAMP - 16) / 8).astype(np.uint16)  # an eighth of the exposure
    picture = to_8_bits(dim)
    assert picture[0, 0] == 0
    assert 0.005 <= np.mean(picture == 255) < 0.012


def test_the_curve_is_the_stretched_light_to_the_power_of_1_over_2_2():
    light = (RAMP - 16) / np.percentile(RAMP - 16, 99.5)
    np.testing.assert_allclose(to_8_bits(RAMP) / 255, np.clip(light, 0, 1) ** (1 / 2.2), atol=0.5 / 255 + 1e-6)


def test_a_shorter_exposure_gives_an_equal_image_without_clipping():
    long, short = RAMP, (16 + (RAMP - 16) / 4).astype(np.uint16)
    difference = to_8_bits(long).astype(int) - to_8_bits(short)
    assert np.abs(difference[:, 200:]).max() <= 2  # quantisation of the short exposure


def test_noise_of_a_dark_photo_is_not_stretched(rng):
    dark = rng.integers(14, 19, (50, 60)).astype(np.uint16)
    assert to_8_bits(dark).max() == round(255 * (2 / 64) ** (1 / 2.2))  # 2 of 64 DN


def test_shrinking_averages_light():
    checks = np.tile(np.array([[0, 4000], [4000, 0]], np.uint16), (20, 30))  # 60 x 40
    small = shrink(checks, 30)
    assert small.shape == (20, 30)
    np.testing.assert_allclose(small, 2000)


@pytest.mark.parametrize(("kind", "most", "bits"), [("u1", 255, 8), ("u2", 0, 12), ("u2", 4095, 12), ("u2", 4096, 16)])
def test_the_bit_depth_follows_from_the_maximum(kind, most, bits):
    picture = np.array([[0, most]], kind)
    assert bits_in_use(picture, picture.dtype) == bits
    assert bits_in_use(picture[:, :0], picture.dtype) in (8, 12)


def test_underexposed_eight_bit_images_are_brightened():
    ramp = np.tile(np.arange(256, dtype=np.uint8), (64, 1))
    np.testing.assert_array_equal(brighten(ramp), ramp)
    np.testing.assert_allclose(brighten(ramp // 4), ramp, atol=5)
    assert brighten(ramp // 64).max() == 8 * 3  # maximum gain
    assert not brighten(np.zeros((8, 8), np.uint8)).any()
