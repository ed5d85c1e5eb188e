"""Map by which the rover drives: bounds, decay and fusion of updates."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.rover.perception.hazard_grid import (
    DECAY_S,
    MAX_LOG_ODDS,
    MISS_LOG_ODDS,
    PARTS,
    HazardGrid,
    MapUpdate,
    without_gaps,
)
from polarsim.rover.world.surface import bare_world

WORLD = bare_world(np.zeros((16, 16)), 0.1, 0.0, 0.0)


def grid() -> HazardGrid:
    return HazardGrid(WORLD)


def uniform(rock: float, weight: float = 1.0, height: float = 0.2, surface: float = np.nan) -> MapUpdate:
    empty = grid()
    shape = empty.log_odds.shape
    values = (np.full(shape, value) for value in (weight, rock, height))
    return MapUpdate(*values, np.full(empty.surface.shape, surface))


@given(st.lists(st.tuples(st.floats(0, 1), st.floats(0, 3)), max_size=30))
def test_log_odds_are_bounded_and_an_update_without_weight_changes_nothing(updates):
    fused = grid()
    fused.add(uniform(3.0, weight=0.0))
    assert not fused.seen.any()
    assert not fused.log_odds.any()
    for weight, rock in updates:
        fused.add(uniform(rock, weight))
    assert np.abs(fused.log_odds).max() <= MAX_LOG_ODDS


@given(st.floats(0, 500))
def test_log_odds_decay_exponentially(seconds):
    fused = grid()
    fused.add(uniform(2.0))
    fused.fade(seconds)
    np.testing.assert_allclose(fused.log_odds, 2.0 * math.exp(-seconds / DECAY_S), rtol=1e-12)


def test_updates_without_a_rock_remove_it_and_heights_are_averaged():
    fused = grid()
    fused.add(uniform(1.0, height=0.1))
    fused.add(uniform(1.0, height=0.2))
    np.testing.assert_allclose(fused.height, 0.15)
    assert fused.hazards(0.12).all()
    assert not fused.hazards(0.16).any()
    for _ in range(3):
        fused.add(uniform(0.0))
    np.testing.assert_allclose(fused.log_odds, 2.0 - 3 * MISS_LOG_ODDS)
    assert not fused.rock.any()


def test_surface_heights_are_weighted_means_of_the_observed_parts():
    fused = grid()
    update = uniform(0.0, weight=1.0, surface=0.10)
    update.surface[0, 0] = np.nan
    fused.add(update)
    fused.add(uniform(0.0, weight=0.5, surface=0.40))
    assert fused.surface[0, 0] == pytest.approx(0.40)
    np.testing.assert_allclose(fused.surface.ravel()[1:], (0.10 + 0.5 * 0.40) / 1.5)
    expected = ((PARTS**2 - 1) * 0.20 + 0.40) / PARTS**2
    assert fused.surface_of_cells()[0, 0] == pytest.approx(expected)


@given(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3))
def test_gaps_in_a_plane_are_filled_up_to_the_maximum_distance(along_x, along_y):
    rows, columns = np.mgrid[:20, :30]
    plane = along_x * columns + along_y * rows
    gap = plane.copy()
    gap[5:12, 8:20] = np.nan
    np.testing.assert_allclose(without_gaps(gap, 4), plane, atol=1e-9)
    near = without_gaps(gap, 2)
    assert np.isnan(near[8, 14])
    assert np.isfinite(near[6, 9])
    assert np.isnan(without_gaps(np.full((3, 3), np.nan), 2)).all()
