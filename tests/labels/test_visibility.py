import numpy as np
import pytest

from polarsim.labels.brightness import Brightness, noise_dn
from polarsim.labels.visibility import label_contrast

BOX = np.array([100.0, 80, 160, 120])


def scene(inside: float, outside: float, noise: float = 0.0) -> Brightness:
    rate = np.full((300, 400), outside)
    rate[80:120, 100:160] = inside
    rate += noise * np.random.default_rng(1).standard_normal(rate.shape)
    return Brightness(rate.astype(np.float32), (64, 256), 1.0)


def test_contrast_is_the_difference_relative_to_pixel_noise():
    assert label_contrast(scene(0.1, 1.0), BOX, 100).snr == pytest.approx(90 / noise_dn(100.0), rel=0.01)


def test_a_rock_with_the_mean_brightness_of_sand_has_contrast():
    both = scene(1.0, 1.0)
    both.rate[80:120, 100:130], both.rate[80:120, 130:160] = 0.2, 1.8
    assert label_contrast(both, BOX, 100).snr > 20


def test_longer_exposures_show_more_until_they_clip():
    shown = [label_contrast(scene(0.1, 1.0), BOX, exposure).snr for exposure in (16, 64, 256, 1024)]
    assert shown == sorted(shown)
    assert label_contrast(scene(100.0, 200.0), BOX, 256).snr == 0  # both are white


def test_noise_has_no_contrast():
    noise = float(noise_dn(100.0)) / 100
    assert label_contrast(scene(1.0, 1.0, noise), BOX, 100).snr < 0.5


def test_a_black_photo_has_no_contrast():
    assert label_contrast(scene(0.0, 0.0), BOX, 8192).snr == 0


@pytest.mark.parametrize("box", [[-20, -20, -5, -5], [0, 0, 400, 300], [399, 299, 400, 300]])
def test_boxes_without_a_surround_have_none(box):
    assert label_contrast(scene(0.1, 1.0), np.array(box, float), 100).snr == 0
