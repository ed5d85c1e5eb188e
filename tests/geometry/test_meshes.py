"""Tests of triangle meshes."""

import numpy as np
import pytest

from polarsim.geometry.meshes import Mesh, subdivide_smoothly
from polarsim.geometry.topology import hull_faces, is_watertight

CORNERS = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
OCTAHEDRON = Mesh(CORNERS, hull_faces(CORNERS))


def off_the_sphere(mesh: Mesh) -> float:
    """Return the distances of triangle centres below the unit sphere."""
    return float(1 - np.linalg.norm(mesh.vertices[mesh.faces].mean(axis=1), axis=1).mean())


def test_a_subdivided_octahedron_keeps_its_corners_and_approaches_the_sphere():
    once, twice = subdivide_smoothly(OCTAHEDRON), subdivide_smoothly(subdivide_smoothly(OCTAHEDRON))
    np.testing.assert_array_equal(once.vertices[:6], CORNERS)
    assert len(twice.faces) == 16 * len(OCTAHEDRON.faces)
    assert is_watertight(once.faces)
    assert is_watertight(twice.faces)
    outward = np.cross(*(twice.vertices[twice.faces[:, k]] - twice.vertices[twice.faces[:, 0]] for k in (1, 2)))
    assert ((outward * twice.vertices[twice.faces].mean(axis=1)).sum(axis=1) > 0).all()
    assert off_the_sphere(twice) < off_the_sphere(once) < off_the_sphere(OCTAHEDRON) / 2


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_a_flat_mesh_stays_flat(turn):
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    slope = np.array([[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]])
    finer = subdivide_smoothly(Mesh(square @ slope.T, np.array([[0, 1, 2], [0, 2, 3]])))
    np.testing.assert_allclose((finer.vertices @ slope)[:, 2], 0, atol=1e-15)
    assert len(finer.vertices) == 9
