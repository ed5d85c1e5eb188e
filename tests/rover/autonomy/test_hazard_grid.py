"""The rover's map: bounds, fading, and looks that raise and lower."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.rover.autonomy.hazard_grid import HazardGrid, Look
from polarsim.rover.autonomy.options import MapOptions
from polarsim.rover.world.surface import bare_world

WORLD = bare_world(np.zeros((16, 16)), 0.1, 0.0, 0.0)


def grid() -> HazardGrid:
    return HazardGrid(WORLD, MapOptions())


def look(rock: float, weight: float = 1.0, height: float = 0.2) -> Look:
    shape = grid().log_odds.shape
    return Look(*(np.full(shape, value) for value in (weight, rock, height, np.nan)))


@given(st.lists(st.tuples(st.floats(0, 1), st.floats(0, 3)), max_size=30))
def test_log_odds_stay_within_their_bounds(looks):
    own = grid()
    for weight, rock in looks:
        own.add(look(rock, weight))
    assert np.abs(own.log_odds).max() <= own.options.most_log_odds


@given(st.floats(0, 500))
def test_what_is_known_fades_to_one_over_e_in_the_stated_time(seconds):
    own = grid()
    own.add(look(2.0))
    own.fade(seconds)
    np.testing.assert_allclose(own.log_odds, 2.0 * math.exp(-seconds / own.options.decay_s), rtol=1e-12)


def test_looks_without_a_rock_outvote_one_with_it_and_heights_are_means():
    own = grid()
    own.add(look(1.0, height=0.1))
    own.add(look(1.0, height=0.2))
    np.testing.assert_allclose(own.height, 0.15)
    assert own.hazards(0.12).all()
    assert not own.hazards(0.16).any()
    for _ in range(3):
        own.add(look(0.0))
    np.testing.assert_allclose(own.log_odds, 2.0 - 3 * own.options.miss_log_odds)
    assert not own.rock.any()


def test_a_look_without_weight_says_nothing():
    own = grid()
    own.add(look(3.0, weight=0.0))
    assert not own.seen.any()
    assert own.log_odds.any() == pytest.approx(0)
