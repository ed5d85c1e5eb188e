import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL
from polarsim.photo_format import as_stored, in_photo_format
from polarsim.site import polar
from polarsim.site_parts import Images

ALL = np.arange(WHITE_LEVEL + 1, dtype=np.uint16)


def form(bits, black, white=None):
    return Images(width=640, height=480, bits=bits, black=black, white=white)


def test_photos_of_polar_are_unchanged():
    assert as_stored(ALL, polar().images) is ALL
    assert in_photo_format(ALL, polar().images) is ALL


@pytest.mark.parametrize(("bits", "black", "white"), [(8, 4, None), (8, 0, 250), (10, 64, None), (14, 64, 16000)])
def test_black_and_white_of_a_site_become_those_of_the_format(bits, black, white):
    chosen = form(bits, black, white)
    values = np.array([black, chosen.white_level, 2**bits - 1], np.uint16)
    assert in_photo_format(values, chosen).tolist() == [BLACK_LEVEL, WHITE_LEVEL, WHITE_LEVEL]
    levels = np.unique(as_stored(ALL, chosen))
    assert {BLACK_LEVEL, WHITE_LEVEL} <= set(levels.tolist())
    assert len(levels) <= min(chosen.white_level + 1, WHITE_LEVEL + 1)


@given(st.integers(8, 16), st.integers(0, 60))
def test_stored_values_are_stable_and_within_half_a_step(bits, black):
    chosen = form(bits, black)
    stored = as_stored(ALL, chosen)
    assert (as_stored(stored, chosen) == stored).all()  # photo and twin of equal light have equal values
    step = (WHITE_LEVEL - BLACK_LEVEL) / (chosen.white_level - black)
    lit = ALL >= BLACK_LEVEL  # darker pixels are clipped at the value 0 of the site
    assert np.abs(stored[lit].astype(int) - ALL[lit]).max() <= step / 2 + 0.5


def test_colour_becomes_luminance_of_linear_values():
    chosen = form(8, 0)
    colours = np.array([[[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255], [77, 77, 77]]], np.uint8)
    grey = in_photo_format(colours, chosen)[0].astype(int) - BLACK_LEVEL
    np.testing.assert_allclose(grey[:3] / 4079, [0.2126, 0.7152, 0.0722], atol=2e-4)  # ITU-R BT.709
    assert grey[3:].tolist() == [4079, in_photo_format(np.array([[77]], np.uint8), chosen)[0, 0] - BLACK_LEVEL]


def test_values_with_the_curve_of_srgb_become_linear():
    coded = Images(width=640, height=480, bits=8, black=0, curve="srgb")
    linear = (in_photo_format(np.array([0, 10, 188, 255], np.uint8), coded).astype(int) - BLACK_LEVEL) / 4079
    np.testing.assert_allclose(linear, [0, 10 / 255 / 12.92, 0.503, 1], atol=2e-4)  # IEC 61966-2-1
    stored = as_stored(ALL, coded)
    assert (as_stored(stored, coded) == stored).all()
    assert len(np.unique(stored)) > 240
