import numpy as np

from polarsim.relief.plate import plate_filled
from polarsim.rocks.heights import FloorGrid
from polarsim.rocks.scans import Extent

GRID = FloorGrid(Extent(-1.0, -1.0, 1.0, 1.0), 0.02)
X, Y = np.moveaxis(GRID.centres(), -1, 0)


def test_known_values_are_kept_and_a_constant_is_continued():
    known = np.hypot(X, Y) > 0.4
    filled = plate_filled(GRID, np.where(known, 0.03, 99.0), known)
    np.testing.assert_allclose(filled, 0.03, atol=1e-9)


def test_a_bowl_continues_into_a_hole():
    bowl = 0.2 * (X**2 + Y**2)
    known = np.hypot(X - 0.3, Y) > 0.15
    filled = plate_filled(GRID, np.where(known, bowl, 0.0), known)
    np.testing.assert_allclose(filled[known], bowl[known], atol=1e-12)
    assert np.abs(filled - bowl)[~known].max() < 0.002  # metres; a membrane is 4 mm off


def test_nothing_known_is_level():
    assert not plate_filled(GRID, X, np.zeros(GRID.shape, bool)).any()
