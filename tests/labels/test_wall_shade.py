import numpy as np
import pytest

from polarsim.labels.casting import fit_wall_offset


def ground(rng, edge, dark=2.0, lit=20.0):
    """Return heights above the walls and the brightness of patchy sand that is in shadow below `edge`."""
    clearance = rng.uniform(-0.2, 0.5, 5000)
    return clearance, np.where(clearance < edge, dark, lit) * rng.lognormal(0, 0.4, 5000)


@pytest.mark.parametrize("edge", [-0.08, 0.0, 0.11])
def test_the_offset_of_walls_follows_from_the_shadow_edge(rng, edge):
    assert fit_wall_offset(*ground(rng, edge)) == pytest.approx(edge, abs=0.015)


def test_measured_walls_are_moved_by_the_penumbra_only(rng):
    assert fit_wall_offset(*ground(rng, 0.11), measured=True) == 0
    assert fit_wall_offset(*ground(rng, 0.0), measured=True) == pytest.approx(0, abs=0.011)
    clearance, rate = ground(rng, 0.0)
    half_lit = np.where((clearance > 0) & (clearance < 0.01), 4.0, rate)
    assert fit_wall_offset(clearance, half_lit, measured=True) == pytest.approx(0.01)


def test_without_a_shadow_edge_the_walls_are_not_moved(rng):
    assert fit_wall_offset(*ground(rng, -1.0)) == 0
    assert fit_wall_offset(np.zeros(0), np.zeros(0)) == 0
