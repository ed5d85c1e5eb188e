import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.labels.edge_weights import edge_sd_px, mesh_weights

ANNOTATED = np.array([[300.0, 200.0, 360.0, 250.0]])
counts = st.integers(1, 8)
weights = st.floats(0.1, 10)


def of_mesh(off: float, count: int, weight: float) -> float:
    """Return the weight of mesh edges `off` px to the right of the annotated edges."""
    found = mesh_weights(ANNOTATED, np.full((1, 4), float(count)), ANNOTATED + np.array([off, 0, off, 0]), weight)
    np.testing.assert_allclose(found[0, 0], found[0, 2])
    return float(found[0, 0])


@given(counts, weights)
def test_a_mesh_edge_that_agrees_with_annotations_has_full_weight(count, weight):
    np.testing.assert_allclose(of_mesh(0, count, weight), weight)


@given(counts, weights, st.floats(0, 50), st.floats(0.1, 50))
def test_the_weight_of_a_mesh_edge_decreases_with_its_deviation(count, weight, off, more):
    assert of_mesh(off + more, count, weight) < of_mesh(off, count, weight)
    np.testing.assert_allclose(of_mesh(-off, count, weight), of_mesh(off, count, weight))


def test_the_weight_halves_at_cauchys_constant_times_the_standard_deviation():
    off = 2.385 * float(edge_sd_px(ANNOTATED)[0, 0]) * np.sqrt(2)
    np.testing.assert_allclose(of_mesh(off, 1, 1), 0.5)


def test_edges_are_weighted_independently():
    found = mesh_weights(ANNOTATED, np.ones((1, 4)), ANNOTATED + np.array([0, 0, 80, 0]), 1.0)
    np.testing.assert_allclose(found[0, [0, 1, 3]], 1.0)
    assert found[0, 2] < 0.1


@pytest.mark.parametrize("weight", [0.0, 0.5, 1.0])
def test_an_edge_without_annotations_is_the_mesh_edge(weight):
    found = mesh_weights(np.zeros((1, 4)), np.zeros((1, 4)), ANNOTATED, weight)
    np.testing.assert_array_equal(found, np.ones((1, 4)))


@pytest.mark.parametrize("count", [1, 3])
def test_a_mesh_with_weight_zero_is_ignored(count):
    assert of_mesh(3, count, 0) == 0


def test_annotation_errors_increase_with_the_size_of_a_rock():
    sizes = np.array([20.0, 60.0, 150.0])
    sd = edge_sd_px(np.stack([0 * sizes, 0 * sizes, sizes, sizes], axis=1))
    np.testing.assert_allclose(sd[:, 0], [2.74, 3.82, 6.25])
