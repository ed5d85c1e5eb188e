"""A label counts as shown where something stands out in or around its box."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.rover.perception.contrast import shows

PICTURE = np.full((60, 80), 10, np.uint8)
PICTURE[20:40, 10:30] = 200
BOXES = np.array([[10, 20, 30, 40], [50, 20, 70, 40], [0, 0, 80, 60], [40, 50, 80, 60], [31, 20, 35, 40]], float)


def test_a_bright_rock_stands_out_and_one_in_the_dark_does_not():
    assert shows(PICTURE, BOXES, 0.06).tolist() == [True, False, True, False, True]
    assert shows(PICTURE, np.zeros((0, 4)), 0.06).tolist() == []


def test_a_dark_picture_shows_nothing_unless_no_contrast_is_asked_for():
    black = np.zeros((60, 80), np.uint8)
    assert not shows(black, BOXES, 0.01).any()
    assert shows(black, BOXES, 0.0).all()


@given(st.floats(0, 1), st.floats(0, 1), st.integers(0, 2**31))
def test_more_contrast_is_shown_by_fewer(one, other, seed):
    picture = np.random.default_rng(seed).integers(0, 256, (60, 80)).astype(np.uint8)
    low, high = sorted((one, other))
    assert (shows(picture, BOXES, high) <= shows(picture, BOXES, low)).all()


@pytest.mark.parametrize("box", [[-20, 5, -10, 9], [90, 5, 99, 9]])
def test_a_box_outside_the_picture_shows_nothing(box):
    assert not shows(PICTURE, np.array([box], float), 0.0).any()
