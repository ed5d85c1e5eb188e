import numpy as np
import pytest

from polarsim.report.figures.canvas import rgb
from polarsim.report.figures.difference import COLOURS, STOPS, log2_over_photo
from polarsim.report.figures.difference import difference_of_cover as of_cover
from polarsim.report.figures.difference import difference_of_photo as of_photo


def test_a_brighter_twin_is_red_and_a_darker_one_blue():
    photo = np.full((4, 6), 16 + 400, np.uint16)
    twin = photo.copy()
    twin[:, :2], twin[:, 2:4], twin[:, 4:] = 16 + 1600, 16 + 400, 16 + 100
    shown = of_photo(photo, twin)
    (red, _, no_blue), middle, (no_red, _, blue) = shown[0, [0, 2, 4]].astype(int)
    assert min(red - no_blue, blue - no_red) > 100
    assert middle.tolist() == [0xF7] * 3
    assert sorted(log2_over_photo(photo, twin)) == [-2.0] * 8 + [0.0] * 8 + [2.0] * 8


@pytest.mark.parametrize(("sign", "light", "end"), [(1, 256, -1), (-1, 2048, 0)])
def test_colours_are_saturated_beyond_the_range_only(sign, light, end):
    photo = np.full((1, 4), 16 + light, np.uint16)
    stops = sign * np.array([0.5, STOPS - 0.2, STOPS + 0.1, STOPS + 0.5])
    shown = of_photo(photo, np.rint(16 + light * 2.0 ** stops[None]).astype(np.uint16))[0]
    assert shown[0].sum() > shown[1].sum() > shown[2].sum()
    assert shown[2].tolist() == shown[3].tolist() == list(rgb(COLOURS[end]))


def test_dark_and_clipped_pixels_are_grey():
    photo = np.array([[20, 4095, 500]], np.uint16)
    assert of_photo(photo, np.full((1, 3), 500, np.uint16)).tolist() == [[[128] * 3, [128] * 3, [0xF7] * 3]]


def test_a_cover_photo_with_another_tone_curve_has_no_difference(rng):
    twin = rng.integers(16, 4000, (60, 80)).astype(np.uint16)
    tones = np.sqrt((twin - 16) / 4000) * 255
    cover = np.repeat(np.round(tones)[..., None], 3, axis=-1).astype(np.uint8)
    red = np.zeros((60, 80), bool)
    red[0] = True
    shown = of_cover(cover, twin, red)
    assert (shown[0] == 128).all()
    assert (shown[1:] > 230).all()
    mirrored = of_cover(cover, twin[:, ::-1], red)
    assert (mirrored[1:] > 230).mean() < 0.6
