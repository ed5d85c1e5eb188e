import numpy as np
import pytest
from scipy.integrate import quad

from polarsim.geometry.size_frequency import (
    covered_share,
    decay,
    fit_abundance,
    number_density,
    poisson_interval,
)


def test_the_law_has_the_published_coefficients():
    assert decay(0.1) == pytest.approx(3.31)  # q(k) = 1.79 + 0.152 / k
    assert covered_share(0.0, 0.2) == 0.2
    assert covered_share(0.5, 0.1) == pytest.approx(0.1 * np.exp(-1.655))


@pytest.mark.parametrize("k", [0.01, 0.2])
def test_the_number_density_is_the_integral_of_covered_area_over_disc_area(k):
    q = float(decay(k))
    expected = quad(lambda d: k * q * np.exp(-q * d) / (np.pi / 4 * d**2), 0.08, 30)[0]
    assert number_density(0.08, k) == pytest.approx(expected, rel=1e-6)


def test_intervals_contain_the_true_abundance_of_simulated_rocks():
    random, k, area, smallest = np.random.default_rng(0), 0.1, 16.0, 0.08
    grid = np.linspace(smallest, 3, 20_000)
    below = 1 - number_density(grid, k) / number_density(smallest, k)
    fits = []
    for _ in range(100):
        count = random.poisson(area * number_density(smallest, k))
        fits.append(fit_abundance(np.interp(random.random(count), below, grid), area, smallest))
    assert np.mean([fit.k for fit in fits]) == pytest.approx(k, rel=0.05)
    assert 0.89 <= np.mean([fit.low <= k <= fit.high for fit in fits]) <= 0.99


def test_small_rocks_do_not_change_the_fit_and_no_rock_gives_an_upper_bound():
    diameters = np.array([0.1, 0.12, 0.3])
    assert fit_abundance(diameters, 16.0, 0.08) == fit_abundance(np.append(diameters, [0.01] * 50), 16.0, 0.08)
    empty = fit_abundance(np.zeros(0), 16.0, 0.08)
    assert (empty.k, empty.low) == (0, 0)
    assert 16 * number_density(0.08, empty.high) == pytest.approx(1.92, abs=0.01)  # deviance of Poisson's law


def test_poisson_intervals_are_those_of_garwoods_table():
    low, high = poisson_interval(np.array([0, 1, 10]))
    np.testing.assert_allclose(low, [0, 0.0253, 4.7954], atol=1e-4)
    np.testing.assert_allclose(high, [3.6889, 5.5716, 18.3904], atol=1e-4)
