import numpy as np
import pytest

from polarsim.detect import tone as of_training
from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL
from polarsim.tone import display_white_level, encode_tone, to_8bit, white_level


def test_the_curve_is_linear_to_white_and_then_gamma():
    light = np.array([-5.0, 0, 25, 50, 100, 400])
    np.testing.assert_array_equal(encode_tone(light, 100, gamma=1), [0, 0, 64, 128, 255, 255])
    np.testing.assert_array_equal(encode_tone(light, 100), [0, 0, 136, 186, 255, 255])  # 255 (1/4, 1/2) ** (1 / 2.2)


def test_the_white_level_has_a_minimum_and_a_maximum():
    assert white_level(np.zeros(9), 99, 40) == 40
    assert white_level(np.full(9, 1e5), 99, 40) == WHITE_LEVEL - BLACK_LEVEL


@pytest.mark.parametrize("brightest", [60, 900, WHITE_LEVEL])
def test_displayed_and_training_pictures_have_one_curve(brightest):
    """With the same white level, displayed and training images are equal."""
    pixels = np.linspace(0, brightest, 600).astype(np.uint16).reshape(20, 30)
    light = np.clip(pixels.astype(float) - BLACK_LEVEL, 0, None)
    white = white_level(light, 99.5, 64)
    training = of_training.to_8_bits(pixels)
    assert (
        np.abs(training.astype(int) - to_8bit(pixels, white)[..., 0]).max() <= 1
    )  # training images are computed in float32
    assert display_white_level(pixels) >= 40
