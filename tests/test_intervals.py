"""95 % intervals against formulas and each other."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.intervals import (
    bootstrap_draws,
    bootstrap_interval,
    percentile_interval,
    resampled_means,
    resampled_medians,
    student_interval,
)
from polarsim.randomness import generator


def test_every_resample_draws_as_many_units_as_there_are_and_purposes_differ():
    drawn = bootstrap_draws(7, 100, 3)
    assert (drawn.sum(axis=1) == 7).all()
    np.testing.assert_array_equal(drawn, bootstrap_draws(7, 100, 3))
    assert not np.array_equal(drawn, bootstrap_draws(7, 100, 3, "masks"))


def by_weights(values: np.ndarray) -> tuple[float, float]:
    units = np.arange(len(values))
    return percentile_interval(resampled_means(values, units, bootstrap_draws(len(values), 4000, 0)), len(values))


def by_groups(values: np.ndarray) -> tuple[float, float]:
    return bootstrap_interval(list(values[:, None]), lambda own: float(np.mean(own)), generator(0, "test"), 4000)


@pytest.mark.parametrize("method", [by_weights, by_groups, student_interval])
def test_the_interval_of_a_mean_is_the_normal_one_for_many_units_and_none_of_one(method, rng):
    values = rng.normal(5, 2, 400)
    half = 1.96 * values.std() / 20
    np.testing.assert_allclose(method(values), [values.mean() - half, values.mean() + half], atol=0.1 * half)
    assert np.isnan(method(values[:1])).all()


def test_students_interval_of_three_values_is_that_of_the_table_of_t():
    assert student_interval(np.array([1.0, 2.0, 3.0])) == pytest.approx(
        (2 - 4.3027 / 3**0.5, 2 + 4.3027 / 3**0.5), abs=1e-4
    )


def test_resamples_without_a_value_are_left_out():
    means = resampled_means(np.array([1.0, 3.0]), np.array([0, 0]), np.array([[0.0, 2.0], [1.0, 1.0], [2.0, 0.0]]))
    assert np.isnan(means[0])
    assert percentile_interval(means, 2) == (2.0, 2.0)
    assert np.isnan(percentile_interval(np.full(3, np.nan), 2)).all()


@given(st.lists(st.tuples(st.integers(-5, 5), st.integers(0, 3)), min_size=1, max_size=9))
def test_resampled_medians_are_those_of_repeated_values(pairs):
    values, unit = np.array(pairs, float).T
    drawn = bootstrap_draws(4, 20, 1)
    medians = resampled_medians(values, unit.astype(int), drawn)
    repeats = [np.repeat(values, draws[unit.astype(int)].astype(int)) for draws in drawn]
    np.testing.assert_array_equal(medians, [np.median(each) if len(each) else np.nan for each in repeats])
    assert np.isnan(resampled_medians(values[:0], unit[:0].astype(int), drawn)).all()
