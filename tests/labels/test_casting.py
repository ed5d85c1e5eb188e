import numpy as np
import pytest

from polarsim.labels.brightness import Brightness
from polarsim.labels.casting import fit_to_dark_region
from polarsim.photo import NO_ROCK

STEP = 2
SHAPE = (600, 800)
NO_ROCKS = np.full((SHAPE[0] // STEP, SHAPE[1] // STEP), NO_ROCK)


def dark(*boxes, level: float = 0.1, ground: float = 1.0) -> Brightness:
    rate = np.full(SHAPE, ground, np.float32)
    for x0, y0, x1, y1 in boxes:
        rate[y0:y1, x0:x1] = level
    return Brightness(rate, (256,), 1.0)


def cast(x0, y0, x1, y1, rock=4):
    shadow = NO_ROCKS.copy()
    shadow[y0 // STEP : y1 // STEP, x0 // STEP : x1 // STEP] = rock
    return shadow


def test_edges_move_to_the_dark_region():
    box, real = np.array([200.0, 200, 320, 240]), (206, 196, 326, 234)
    found = fit_to_dark_region(box, cast(200, 200, 320, 240), NO_ROCKS, STEP, 4, dark(real))
    np.testing.assert_allclose(found, real, atol=2)


def test_thin_dark_streaks_of_the_ground_do_not_count():
    box, real = np.array([200.0, 200, 320, 240]), (200, 200, 320, 240)
    streak = (320, 220, 420, 222)
    found = fit_to_dark_region(box, cast(*real), NO_ROCKS, STEP, 4, dark(real, streak))
    np.testing.assert_allclose(found, real, atol=6)  # of the streak's 100 px no more stays than the brush is wide


def test_the_shadow_of_another_rock_is_left_out():
    box, other = np.array([200.0, 200, 320, 240]), (320, 200, 420, 240)
    shadow = cast(200, 200, 320, 240)
    shadow[100:120, 160:210] = 9
    found = fit_to_dark_region(box, shadow, NO_ROCKS, STEP, 4, dark((200, 200, 320, 240), other))
    np.testing.assert_allclose(found, box, atol=3)


@pytest.mark.parametrize(
    "photo",
    [
        pytest.param(dark(), id="no dark region"),
        pytest.param(dark((0, 0, 800, 600)), id="all is dark"),
        pytest.param(dark((200, 200, 320, 240), level=0.8), id="hardly darker than the ground"),
        pytest.param(dark((200, 200, 320, 240), level=0.0, ground=0.002), id="too dark to tell"),
        pytest.param(dark((200, 200, 225, 215)), id="much smaller than the cast shadow"),
    ],
)
def test_a_photo_that_does_not_show_the_shadow_moves_nothing(photo):
    assert (
        fit_to_dark_region(np.array([200.0, 200, 320, 240]), cast(200, 200, 320, 240), NO_ROCKS, STEP, 4, photo) is None
    )
