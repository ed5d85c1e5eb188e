"""Rocks by Golombek and Rapp's law, with shapes of a run's rocks."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.spatial import ConvexHull

from polarsim.errors import RoverError
from polarsim.geometry.meshes import Mesh
from polarsim.rover.world.rock_field import (
    CLEAR_M,
    LARGEST_M,
    SMALLEST_M,
    RockModel,
    random_rocks,
    rock_shapes,
    rocks_per_m2,
    smooth,
    vertices_in_world,
)
from polarsim.rover.world.stitch import TerrainSolids
from tests.rover.made_world import ball, plane

NOWHERE = np.zeros((0, 2))


def shape(diameter=0.1):
    return RockModel(1, 1, diameter, (ball(0, 0, 0, 0.5),))


def covered_share(diameter_m: float, abundance: float) -> float:
    """Return the share of the ground covered by rocks of at least this diameter (Golombek and Rapp, 1997)."""
    return abundance * np.exp(-(1.79 + 0.152 / abundance) * diameter_m)


@pytest.mark.parametrize("abundance", [0.01, 0.1])
def test_rocks_cover_the_share_of_the_law(abundance):
    """The integral of density times outline from a size on is the share of the law."""
    for smallest in (0.05, 0.3):

        def covers(d, step=1e-5):
            density = (rocks_per_m2(d - step, abundance) - rocks_per_m2(d + step, abundance)) / (2 * step)
            return density * np.pi * d * d / 4

        share = quad(covers, smallest, 5.0, limit=200)[0]
        expected = covered_share(smallest, abundance) - covered_share(5.0, abundance)
        assert share == pytest.approx(float(expected), rel=1e-3)


def test_sizes_follow_the_law_and_rocks_do_not_overlap():
    start = np.array([[5.0, 0.0]])
    field, again, other = (random_rocks(0.05, [shape()], 20.0, start, seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(field.x, again.x)
    assert not np.array_equal(field.x, other.x)
    assert (np.diff(field.diameter) <= 0).all()
    for size in (SMALLEST_M, 0.1, 0.2):
        expected = 400 * (rocks_per_m2(size, 0.05) - rocks_per_m2(LARGEST_M, 0.05))
        assert (field.diameter >= size).sum() == pytest.approx(expected, abs=4 * np.sqrt(expected))
    place = np.stack([field.x, field.y], axis=1)
    gap = np.linalg.norm(place[:, None] - place, axis=-1) - (field.diameter[:, None] + field.diameter) / 2
    assert gap[~np.eye(len(place), dtype=bool)].min() > 0
    assert np.linalg.norm(place - start, axis=1).min() > CLEAR_M
    assert np.abs(place).max() <= 10


def test_large_rocks_use_shapes_of_the_larger_half():
    shapes = [shape(diameter) for diameter in (0.3, 0.06, 0.2, 0.08)]
    field = random_rocks(0.1, shapes, 10.0, NOWHERE, 0)
    large = field.diameter > 0.14
    assert set(field.shape[large]) == {0, 2}
    assert set(field.shape[~large]) == {0, 1, 2, 3}


def test_a_shape_has_unit_diameter_and_the_ground_at_zero():
    terrain = TerrainSolids(4, plane(-0.3), {7: ball(0.2, -0.1, -0.26, 0.1)})  # the centre is 4 cm above the ground
    (rock,) = rock_shapes([terrain], (20,))
    fine, coarse = rock.levels
    assert (rock.terrain, rock.rock) == (4, 7)
    assert rock.diameter_m == pytest.approx(0.2, rel=0.03)
    assert rock.diameter_m * fine.vertices[:, 2].max() == pytest.approx(0.14, abs=1e-3)
    assert len(coarse.faces) <= 36 < len(fine.faces)
    assert (coarse.vertices[:, None] == fine.vertices).all(axis=-1).any(axis=1).all()
    assert (np.einsum("ij,ij->i", coarse.normals(), coarse.vertices - coarse.vertices.mean(axis=0)) > 0).all()
    placed = vertices_in_world(fine, 0.5, 0.3, np.array([3.0, 2.0, 1.0]))
    outline = ConvexHull(placed[:, :2]).volume
    assert outline == pytest.approx(np.pi * 0.5**2 / 4, rel=0.01)
    np.testing.assert_allclose(placed[:, :2].mean(axis=0), [3.0, 2.0], atol=0.01)
    corner = Mesh(np.array([[1.0, 0.0, 0.5]]), np.zeros((0, 3), int))
    rotated = vertices_in_world(corner, 2.0, np.pi / 2, np.array([1.0, 1, 1]))
    np.testing.assert_allclose(rotated, [[1.0, 3.0, 2.0]], atol=1e-12)


def test_large_shapes_have_more_triangles():
    mesh = ball(0, 0, 0, radius=0.5)
    small, large, huge = (smooth(mesh, diameter_m) for diameter_m in (0.1, 0.5, 20.0))
    assert small is mesh
    edges = np.linalg.norm(large.vertices[large.faces] - large.vertices[np.roll(large.faces, 1, axis=1)], axis=2)
    assert 0.01 <= 0.5 * np.median(edges) <= 0.021
    assert len(large.faces) < len(huge.faces) <= 50_000


def test_terrains_without_rocks_are_an_error():
    with pytest.raises(RoverError, match=r"rover\.world\.dem\.rocks"):
        rock_shapes([TerrainSolids(4, plane(0.0), {})], ())
