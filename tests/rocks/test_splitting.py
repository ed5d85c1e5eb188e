"""Touching rocks are told apart; hidden cells and chips cut no rock in two."""

import numpy as np
import pytest
from scipy import ndimage

from polarsim.rocks.splitting import told_apart

CELL = 0.005  # metres
LOWEST_PEAK = 0.02  # metres


def domes(*places: tuple[float, float, float], size: int = 120) -> np.ndarray:
    """Heights of half balls at (row, column) of a radius, all in cells; heights in metres."""
    rows, columns = np.indices((size, size))
    above = np.zeros((size, size))
    for row, column, radius in places:
        square = radius**2 - (rows - row) ** 2 - (columns - column) ** 2
        above = np.maximum(above, CELL * np.sqrt(np.clip(square, 0, None)))
    return above


def regions(above: np.ndarray, seen: np.ndarray | None = None) -> np.ndarray:
    labels, _ = ndimage.label((above > 0.01) & (True if seen is None else seen))
    return told_apart(above, labels, np.ones_like(labels, bool) if seen is None else seen, LOWEST_PEAK)


def numbers(parts: np.ndarray) -> list[int]:
    return [number for number in np.unique(parts) if number]


def test_one_rock_stays_one():
    assert len(numbers(regions(domes((60, 60, 20))))) == 1


@pytest.mark.parametrize("gap", [38, 40])
def test_two_rocks_that_touch_come_out_as_two(gap):
    parts = regions(domes((60, 40, 20), (60, 40 + gap, 20)))
    assert len(numbers(parts)) == 2
    assert parts[60, 40] != parts[60, 40 + gap]


def test_a_hidden_notch_does_not_cut_a_rock_in_two():
    above = domes((60, 60, 20))
    seen = np.ones(above.shape, bool)
    seen[46:, 58:61] = False
    assert len(numbers(regions(np.where(seen, above, 0.0), seen))) == 1


def test_a_crumb_in_the_hull_of_a_rock_is_a_part_of_it():
    above = domes((60, 60, 25))
    seen = np.ones(above.shape, bool)
    seen[40:55, 55:70] = False  # an overhang hides what joins the crumb to its rock
    seen[46:49, 61:64] = True
    other = domes((100, 20, 8))  # a later region, whose number must survive the gap that the crumb leaves
    parts = regions(np.where(seen, np.maximum(above, other), 0.0), seen)
    assert len(numbers(parts)) == 2


def test_bare_ground_has_no_region():
    assert numbers(regions(np.zeros((40, 40)))) == []
