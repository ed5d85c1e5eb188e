import numpy as np

from polarsim.geometry.aggregation import aggregate, minima

SMALL, LARGE = 0.1, 1.0


def path_costs(cost: np.ndarray) -> np.ndarray:
    """Return the recursion of Hirschmueller (2008), equation 13, along the first axis (n, k)."""
    total = np.zeros_like(cost)
    total[0] = cost[0]
    change = np.abs(np.subtract.outer(np.arange(cost.shape[1]), np.arange(cost.shape[1])))
    penalty = np.select([change == 0, change == 1], [0.0, SMALL], LARGE)
    for row in range(1, len(cost)):
        total[row] = cost[row] + (total[row - 1] + penalty).min(axis=1) - total[row - 1].min()
    return total


def along(cost: np.ndarray, down: int, right: int) -> np.ndarray:
    """Return the path costs of one direction, cell by cell from the border."""
    rows, columns, _ = cost.shape
    total = np.zeros_like(cost)
    for row in range(rows):
        for column in range(columns):
            if 0 <= row - down < rows and 0 <= column - right < columns:
                continue  # not the start of a path
            steps = [
                k for k in range(max(rows, columns)) if 0 <= row + k * down < rows and 0 <= column + k * right < columns
            ]
            at = ([row + k * down for k in steps], [column + k * right for k in steps])
            total[at] = path_costs(cost[at])
    return total


def test_costs_are_means_over_eight_directions():
    cost = np.random.default_rng(0).random((5, 7, 4)).astype(np.float32)
    expected = np.mean([along(cost, y, x) for y in (-1, 0, 1) for x in (-1, 0, 1) if y or x], axis=0)
    np.testing.assert_allclose(aggregate(cost, SMALL, LARGE), expected, rtol=1e-5)


def test_a_cell_without_preference_takes_the_candidate_of_its_neighbours():
    cost = np.ones((9, 9, 5), np.float32)
    cost[..., 3] = 0
    cost[3:6, 3:6] = 0.5
    assert (aggregate(cost, SMALL, LARGE).argmin(axis=2) == 3).all()


def test_the_minimum_of_a_parabola_is_exact():
    place = np.linspace(1.2, 3.7, 12).reshape(3, 4)
    cost = (np.arange(6) - place[..., None]) ** 2
    np.testing.assert_allclose(minima(cost), place, atol=1e-12)
