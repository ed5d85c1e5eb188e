import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.detect.bootstrap_numba import resampled_precision
from polarsim.detect.grouping import units_of
from polarsim.detect.metrics import precision_at_recalls, rank
from polarsim.errors import DetectError
from polarsim.intervals import bootstrap_draws

AREAS = [(0.0, np.inf), (0.0, 60.0**2), (60.0**2, np.inf)]


def case(rng, pictures):
    """Return labels (n, 4) and predictions (m, 5): jittered copies and false positives."""
    found = []
    for _ in range(pictures):
        corner, size = rng.uniform(0, 1000, (6, 2)), rng.uniform(20, 120, (6, 2))
        label = np.concatenate([corner, corner + size], axis=1)
        prediction = np.concatenate([label + rng.normal(0, spread, label.shape) for spread in (2, 10, 200)])
        prediction[:, 2:] = np.maximum(prediction[:, 2:], prediction[:, :2] + 1)
        found.append((label, np.column_stack([prediction, rng.uniform(0, 1, len(prediction)).round(2)])))
    return tuple(zip(*found, strict=True))


@given(st.integers(0, 2**32 - 1), st.integers(1, 12), st.integers(1, 6))
def test_a_replicate_equals_average_precision_with_weights(seed, pictures, units):
    rng = np.random.default_rng(seed)
    ranked = rank(*case(rng, pictures), areas=AREAS)
    unit, drawn = rng.integers(0, units, pictures), bootstrap_draws(units, 20, seed % 97)
    for area in range(len(AREAS)):
        expected = [precision_at_recalls(ranked, area, weights[unit]).mean(axis=1) for weights in drawn]
        np.testing.assert_allclose(resampled_precision(ranked, area, unit, drawn), expected, atol=1e-12)


def test_a_replicate_without_labels_has_no_precision():
    ranked = rank([np.zeros((0, 4)), np.array([[0.0, 0, 9, 9]])], [np.zeros((0, 5))] * 2)
    found = resampled_precision(ranked, 0, np.array([0, 1]), np.array([[2.0, 0], [1, 1]]))
    assert np.isnan(found[0]).all()
    assert (found[1] == 0).all()


def test_photos_of_a_view_form_a_unit():
    keys = ["01_A_off_180_L_0256", "01_A_on_30_L_0512", "01_A_off_180_R_0256", "02_A_off_180_L_0256"]
    assert units_of(keys, "view").tolist() == [0, 0, 1, 2]
    assert units_of(keys, "photo").tolist() == [0, 2, 1, 3]


def test_names_without_photo_key_require_unit_photo():
    assert units_of(["b", "a"], "photo").tolist() == [1, 0]
    with pytest.raises(DetectError):
        units_of(["b", "a"], "view")
