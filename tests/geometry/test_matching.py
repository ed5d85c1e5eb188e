import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from polarsim.geometry import matching, matching_numba

THRESHOLDS = np.linspace(0.5, 0.95, 10)


def test_the_most_confident_prediction_gets_the_best_free_label():
    overlap = np.array([[0.6, 0.8], [0.7, 0.9], [0.55, 0.0]])
    right, passed = matching.match_predictions_of_photo(overlap, np.array([0.5]), np.zeros((1, 2), bool))
    assert right[0, 0].tolist() == [
        True,
        True,
        False,
    ]  # the first prediction matches the second label
    assert not passed.any()


@given(st.integers(0, 2**32 - 1), st.integers(0, 9), st.integers(0, 7))
def test_compiled_matching_equals_the_reference(seed, predictions, labels):
    rng = np.random.default_rng(seed)
    overlap = rng.integers(0, 11, (predictions, labels)) / 10  # tenths: many are equal, and at thresholds
    other = rng.random((3, labels)) < [[0.0], [0.5], [1.0]]
    for found, expected in zip(
        matching_numba.match_predictions_of_photo(overlap, THRESHOLDS, other),
        matching.match_predictions_of_photo(overlap, THRESHOLDS, other),
        strict=True,
    ):
        np.testing.assert_array_equal(found, expected)
