import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.labels.fusion import edge_sd_px, mesh_weights

ANNOTATED = np.array([[300.0, 200.0, 360.0, 250.0]])
counts = st.integers(1, 8)
weights = st.floats(0.1, 10)


def of_mesh(off: float, count: int, weight: float) -> float:
    """Weight of mesh edges that all lie `off` px to the right of the annotated ones."""
    found = mesh_weights(ANNOTATED, np.full((1, 4), float(count)), ANNOTATED + np.array([off, 0, off, 0]), weight)
    np.testing.assert_allclose(found[0, 0], found[0, 2])
    return float(found[0, 0])


@given(counts, weights)
def test_a_mesh_that_agrees_with_the_drawings_has_its_full_weight(count, weight):
    np.testing.assert_allclose(of_mesh(0, count, weight), weight)


@given(counts, weights, st.floats(0, 50), st.floats(0.1, 50))
def test_a_mesh_counts_the_less_the_farther_off_it_lies(count, weight, off, more):
    assert of_mesh(off + more, count, weight) < of_mesh(off, count, weight)
    np.testing.assert_allclose(of_mesh(-off, count, weight), of_mesh(off, count, weight))


@given(counts, weights)
def test_a_mesh_far_off_moves_the_fused_edge_less_than_one_that_is_near(count, weight):
    def moved(off):
        own = of_mesh(off, count, weight)
        return own * off / (own + count)

    assert moved(500) < moved(5)


@given(weights, st.floats(1, 50))
def test_many_drawings_distrust_a_mesh_more_than_one_does(weight, off):
    assert of_mesh(off, 4, weight) < of_mesh(off, 1, weight)


def test_one_drawing_and_an_equal_mesh_halve_its_weight_at_the_sd_of_their_difference_times_cauchys_constant():
    off = 2.385 * float(edge_sd_px(ANNOTATED)[0, 0]) * np.sqrt(2)
    np.testing.assert_allclose(of_mesh(off, 1, 1), 0.5)


def test_every_edge_is_evaluated_by_itself():
    found = mesh_weights(ANNOTATED, np.ones((1, 4)), ANNOTATED + np.array([0, 0, 80, 0]), 1.0)
    np.testing.assert_allclose(found[0, [0, 1, 3]], 1.0)
    assert found[0, 2] < 0.1


@pytest.mark.parametrize("weight", [0.0, 0.5, 1.0])
def test_an_edge_that_nobody_drew_is_the_meshs(weight):
    found = mesh_weights(np.zeros((1, 4)), np.zeros((1, 4)), ANNOTATED, weight)
    np.testing.assert_array_equal(found, np.ones((1, 4)))


@pytest.mark.parametrize("count", [1, 3])
def test_a_mesh_of_weight_nothing_does_not_count_beside_drawings(count):
    assert of_mesh(3, count, 0) == 0


def test_people_draw_large_rocks_with_larger_errors():
    sizes = np.array([20.0, 60.0, 150.0])
    sd = edge_sd_px(np.stack([0 * sizes, 0 * sizes, sizes, sizes], axis=1))
    np.testing.assert_allclose(sd[:, 0], [2.74, 3.82, 6.25])
