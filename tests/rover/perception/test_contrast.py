"""A label is visible if the contrast in or around its box is high enough."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.rover.perception import contrast
from polarsim.rover.perception.contrast import boxes_with_contrast

PICTURE = np.full((60, 80), 10, np.uint8)
PICTURE[20:40, 10:30] = 200
BOXES = np.array([[10, 20, 30, 40], [50, 20, 70, 40], [0, 0, 80, 60], [40, 50, 80, 60], [31, 20, 35, 40]], float)


def shown(picture: np.ndarray, boxes: np.ndarray, least_contrast: float) -> np.ndarray:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(contrast, "MIN_CONTRAST", least_contrast)
        return boxes_with_contrast(picture, boxes)


def test_a_bright_rock_is_visible_and_a_rock_in_the_dark_is_not():
    assert boxes_with_contrast(PICTURE, BOXES).tolist() == [True, False, True, False, True]
    assert boxes_with_contrast(PICTURE, np.zeros((0, 4))).tolist() == []
    black = np.zeros((60, 80), np.uint8)
    assert not shown(black, BOXES, 0.01).any()
    assert shown(black, BOXES, 0.0).all()


@given(st.floats(0, 1), st.floats(0, 1), st.integers(0, 2**31))
def test_fewer_boxes_reach_a_higher_contrast(one, other, seed):
    picture = np.random.default_rng(seed).integers(0, 256, (60, 80)).astype(np.uint8)
    low, high = sorted((one, other))
    assert (shown(picture, BOXES, high) <= shown(picture, BOXES, low)).all()


@pytest.mark.parametrize("box", [[-20, 5, -10, 9], [90, 5, 99, 9]])
def test_a_box_outside_the_picture_is_not_visible(box):
    assert not shown(PICTURE, np.array([box], float), 0.0).any()
