"""Scenes of movable parts have the same hits as a single scene, before and after parts have moved."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from polarsim.geometry.casters import make_caster
from polarsim.geometry.rays_embree import MovableMesh, MovableScene


def soup(random, triangles):
    """Return separate triangles around the origin without shared edges, so that no tie depends on a tree."""
    return random.normal(size=(3 * triangles, 3)), np.arange(3 * triangles).reshape(-1, 3)


def rays(random, number):
    return random.normal(size=(number, 3)) * 3, random.normal(size=(number, 3))


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), sizes=st.lists(st.integers(1, 40), min_size=1, max_size=6), moved=st.booleans())
def test_parts_have_the_hits_of_a_single_scene(seed, sizes, moved):
    random = np.random.default_rng(seed)
    soups = [soup(random, size) for size in sizes]
    scene = MovableScene([MovableMesh(*each) for each in soups])
    if moved:
        soups[-1] = (soups[-1][0] + [0.5, -1, 2], soups[-1][1])
        scene.move(len(soups) - 1, soups[-1][0])
        scene.commit()
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in soups)])
    whole = make_caster(
        np.concatenate([vertices for vertices, _ in soups]),
        np.concatenate([faces + start for (_, faces), start in zip(soups, starts, strict=False)]),
    )
    origins, directions = rays(random, 300)
    ours, theirs = scene.caster().nearest(origins, directions), whole.nearest(origins, directions)
    np.testing.assert_array_equal(ours[1], theirs[1])
    np.testing.assert_allclose(ours[0], theirs[0], rtol=1e-5)
    np.testing.assert_array_equal(
        scene.caster().occluded(origins, directions, 1.0), whole.occluded(origins, directions, 1.0)
    )


@pytest.mark.parametrize(("mask", "face"), [(1, 0), (2, 1), (3, 0)])
def test_a_mask_selects_parts(mask, face):
    triangle = np.array([[-1.0, -1, 0], [1, -1, 0], [0, 1, 0]])
    one = np.array([[0, 1, 2]])
    scene = MovableScene([MovableMesh(triangle + np.array([0, 0, 1]), one, 1), MovableMesh(triangle, one, 2)])
    distance, found = scene.caster(mask).nearest(np.array([[0.0, 0, 3]]), np.array([[0.0, 0, -1]]))
    assert found == face
    np.testing.assert_allclose(distance, 2 + face)
