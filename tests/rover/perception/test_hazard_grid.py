"""The rover's map: bounds, fading, and looks that raise and lower."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.rover.perception.hazard_grid import (
    DECAY_S,
    MISS_LOG_ODDS,
    MOST_LOG_ODDS,
    PARTS,
    HazardGrid,
    MapUpdate,
    by_part,
    of_parts,
    without_gaps,
)  # fmt: skip
from polarsim.rover.world.surface import bare_world

WORLD = bare_world(np.zeros((16, 16)), 0.1, 0.0, 0.0)


def grid() -> HazardGrid:
    return HazardGrid(WORLD)


def look(rock: float, weight: float = 1.0, height: float = 0.2, surface: float = np.nan) -> MapUpdate:
    own = grid()
    shape = own.log_odds.shape
    return MapUpdate(*(np.full(shape, value) for value in (weight, rock, height)), np.full(own.surface.shape, surface))


@given(st.lists(st.tuples(st.floats(0, 1), st.floats(0, 3)), max_size=30))
def test_log_odds_stay_within_their_bounds(looks):
    own = grid()
    for weight, rock in looks:
        own.add(look(rock, weight))
    assert np.abs(own.log_odds).max() <= MOST_LOG_ODDS


@given(st.floats(0, 500))
def test_what_is_known_fades_to_one_over_e_in_the_stated_time(seconds):
    own = grid()
    own.add(look(2.0))
    own.fade(seconds)
    np.testing.assert_allclose(own.log_odds, 2.0 * math.exp(-seconds / DECAY_S), rtol=1e-12)


def test_looks_without_a_rock_outvote_one_with_it_and_heights_are_means():
    own = grid()
    own.add(look(1.0, height=0.1))
    own.add(look(1.0, height=0.2))
    np.testing.assert_allclose(own.height, 0.15)
    assert own.hazards(0.12).all()
    assert not own.hazards(0.16).any()
    for _ in range(3):
        own.add(look(0.0))
    np.testing.assert_allclose(own.log_odds, 2.0 - 3 * MISS_LOG_ODDS)
    assert not own.rock.any()


def test_a_look_without_weight_says_nothing():
    own = grid()
    own.add(look(3.0, weight=0.0))
    assert not own.seen.any()
    assert own.log_odds.any() == pytest.approx(0)


def test_surface_heights_are_means_weighted_by_looks_of_those_parts_that_they_show():
    own = grid()
    one = look(0.0, weight=1.0, surface=0.10)
    one.surface[0, 0] = np.nan
    own.add(one)
    own.add(look(0.0, weight=0.5, surface=0.40))
    assert own.surface[0, 0] == pytest.approx(0.40)
    np.testing.assert_allclose(own.surface.ravel()[1:], (0.10 + 0.5 * 0.40) / 1.5)
    expected = ((PARTS**2 - 1) * 0.20 + 0.40) / PARTS**2
    assert own.surface_of_cells()[0, 0] == pytest.approx(expected)


@given(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3))
def test_gaps_in_a_plane_are_filled_by_the_plane_as_far_as_they_may_be(along_x, along_y):
    rows, columns = np.mgrid[:20, :30]
    plane = along_x * columns + along_y * rows
    gap = plane.copy()
    gap[5:12, 8:20] = np.nan
    np.testing.assert_allclose(without_gaps(gap, 4), plane, atol=1e-9)
    near = without_gaps(gap, 2)
    assert np.isnan(near[8, 14])
    assert np.isfinite(near[6, 9])
    assert np.isnan(without_gaps(np.full((3, 3), np.nan), 2)).all()


def test_parts_belong_to_their_cells():
    cells = np.arange(6.0).reshape(2, 3)
    np.testing.assert_array_equal(of_parts(by_part(cells), "max"), cells)
    assert by_part(cells).shape == (2 * PARTS, 3 * PARTS)
