"""Paths keep away from hazards, respect the maximum curvature, and are None if there is no path."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from polarsim.rover.perception.hazard_grid import HazardGrid
from polarsim.rover.planning.options import AutonomyOptions, PlannerOptions
from polarsim.rover.planning.pilot import Pilot, Stop
from polarsim.rover.planning.planner import FINE, Planner, edges, hazard_field
from polarsim.rover.world.surface import bare_world

WHEELS = np.array([[0.642, 0.61], [0.642, -0.61], [-0.642, 0.61], [-0.642, -0.61]])
GRID = HazardGrid(bare_world(np.zeros((81, 121)), 0.1, -2.0, -4.0))
PLANNER = Planner(WHEELS, PlannerOptions())
GOAL = np.array([8.0, 0.0])
X, Y = np.meshgrid(GRID.x, GRID.y)
ROUNDED = (np.sqrt(2) - 1) * GRID.cell_m / FINE  # of distances between diagonal cells of the field


def blocked(*rocks: tuple[float, float]) -> np.ndarray:
    cells = np.zeros(X.shape, bool)
    for x, y in rocks:
        cells |= (np.abs(X - x) < 0.16) & (np.abs(Y - y) < 0.16)
    return cells


def planned(cells: np.ndarray, tall: np.ndarray | None = None) -> np.ndarray | None:
    field = hazard_field(GRID, cells, np.zeros_like(cells) if tall is None else tall, np.ones_like(cells))
    return PLANNER.plan(field, 0.0, 0.0, 0.0, GOAL)


def test_a_path_ends_on_observed_ground_and_without_observations_there_is_none():
    """Without this rule, a rover without lights at night drove over rocks that it did not observe."""
    free = np.zeros(X.shape, bool)
    left_side = (Y > 0.9) & (X > 1.0)
    for seen, exists in ((free, False), (left_side, True)):
        path = PLANNER.plan(hazard_field(GRID, free, free, seen), 0.0, 0.0, 0.0, GOAL)
        assert (path is not None) == exists
    _, y, heading = path[-1]
    wheels = np.array([y + np.sin(heading) * u + np.cos(heading) * v for u, v in WHEELS])
    assert (wheels > 0.8).sum() >= 2


@settings(max_examples=6, deadline=None)
@given(st.lists(st.tuples(st.floats(1.8, 6.0), st.floats(-2.0, 2.0)), max_size=5))
def test_wheels_keep_away_from_hazards_and_curvature_is_limited(rocks):
    path = planned(blocked(*rocks))
    if path is None:
        return
    wheels = np.array([[x + np.cos(a) * u - np.sin(a) * v, y + np.sin(a) * u + np.cos(a) * v]
                       for x, y, a in path[1:] for u, v in WHEELS])  # fmt: skip
    for x, y in zip(X[blocked(*rocks)], Y[blocked(*rocks)], strict=True):
        outside = np.maximum(np.abs(wheels - [x, y]) - GRID.cell_m / 2, 0)
        assert np.hypot(*outside.T).min() > PLANNER.options.wheel_gap_m - ROUNDED
    turned = np.abs(np.diff(path[:, 2]))
    moved = np.hypot(*np.diff(path[:, :2], axis=0).T)
    assert (turned <= PLANNER.options.curvature_1_m * moved * 1.02 + 1e-9).all()  # a chord is shorter than the arc


def test_distances_are_to_the_edges_of_hazards_and_rounded_down(rng):
    """Distances between the centres of cells were up to 7 cm too large, so that a wheel kept 8 cm instead of 15."""
    cells = blocked((3.0, 0.0), (4.0, 0.6))
    field = hazard_field(GRID, cells, cells, np.ones_like(cells))
    x, y = rng.uniform(2.0, 5.0, 2000), rng.uniform(-1.0, 1.6, 2000)
    half = GRID.cell_m / 2
    outside = [np.maximum(np.abs(at[:, None] - centres[cells]) - half, 0) for at, centres in ((x, X), (y, Y))]
    true = np.hypot(*outside).min(axis=1)
    for distances in (field.wheels, field.body):
        computed = field.at(distances, x, y)
        assert (computed <= true + ROUNDED + 1e-9).all()
        assert (computed >= true - 2.5 * field.cell).all()


def test_paths_over_free_ground_are_straight_low_rocks_pass_between_the_wheels_and_a_wall_allows_no_path():
    between = blocked((3.0, 0.0))
    for cells in (blocked(), between):
        np.testing.assert_allclose(planned(cells)[:, 1], 0.0, atol=1e-9)
    assert np.abs(planned(between, between)[:, 1]).max() > 0.5  # too high for the body
    assert planned(np.abs(X - 3.0) < 0.16) is None


def test_all_bends_of_the_lattice_end_at_their_node_and_heading():
    lattice = edges(0.9)
    assert len(lattice) == 48
    for edge in lattice:
        np.testing.assert_allclose(edge.places[-1, :2], 0.15 * np.array([edge.columns, edge.rows]), atol=1e-12)


def pilot_at(*stops):
    """Return a pilot that stopped at positions (x, 0) before."""
    driver = Pilot.__new__(Pilot)
    driver.options, driver.planner, driver._wheelbase = AutonomyOptions(), PLANNER, 1.284
    driver.stops = [Stop(0.0, x, 0.0, 0.0) for x in stops]
    return driver


def test_a_repeated_stop_backs_off_farther_if_there_is_room_on_the_ground():
    """Otherwise the rover returns to the same dead end, too close to turn away."""
    free = hazard_field(GRID, blocked(), blocked(), np.ones_like(blocked()))
    for stops, x, times in (([3.0], 3.0, 1), ([1.0, 3.0], 3.0, 1), ([3.4, 3.0], 3.0, 2), ([2.0] * 9, 2.0, 4)):
        driver = pilot_at(*stops)
        driver._back_off(free, x, 0.0, 0.0)
        assert driver._back_by == pytest.approx(times * 0.8), stops
    driver = pilot_at(0.4, 0.3)  # the ground has room for a single distance only
    driver._back_off(free, 0.3, 0.0, 0.0)
    assert driver._back_by == pytest.approx(0.8)
    assert driver._back_to == (0.3, 0.0)
    driver._back_to = None
    driver._back_off(free, -0.1, 0.0, 0.0)  # the ground ends at -2 m: rear wheels would stop at -1.54 m
    assert driver._back_to is None


@pytest.mark.parametrize("ahead", [(), ((2.5, 0.6), (2.5, -0.6))])
def test_a_rover_next_to_a_hazard_leaves_it_and_a_hazard_below_the_rover_is_ignored(ahead):
    beside = blocked((-0.6, 0.75), *ahead)  # cells within the gap of the left rear wheel
    ground = hazard_field(GRID, beside, np.zeros_like(beside), np.ones_like(beside))
    here = np.zeros(3)
    least = PLANNER.clearance(ground, here)
    assert least < 0
    path = PLANNER.plan(ground, *here, GOAL)
    assert path is not None
    assert (PLANNER.clearance(ground, path) >= least).all()
    distant = np.hypot(path[:, 0], path[:, 1]) > 1.0
    assert (PLANNER.clearance(ground, path[distant]) > 0).all()
    under = blocked((-0.6, 0.0))
    assert planned(under, under) is not None
    assert planned(blocked((1.5, 0.6)), None) is not None
