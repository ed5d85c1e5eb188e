"""Faces of open meshes are oriented by the visible sky."""

import numpy as np
import pytest
import trimesh

from polarsim.geometry.meshes import Mesh
from polarsim.geometry.orientation import oriented


def outward_share(mesh):
    """Return the share of the faces of a mesh around the origin with outward normals."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return ((np.cross(b - a, c - a) * (a + b + c)).sum(axis=1) > 0).mean()


@pytest.mark.parametrize("flipped_share", [0.0, 0.5, 1.0])
def test_faces_of_an_open_shell_with_a_hole_become_outward(rng, flipped_share):
    ball = trimesh.creation.icosphere(3, 0.1)
    height, angle = ball.triangles_center[:, 2], np.arctan2(*ball.triangles_center[:, :2].T)
    faces = ball.faces[(height > -0.03) & ~((np.abs(angle) < 0.4) & (np.abs(height - 0.04) < 0.02))].copy()
    flipped = rng.random(len(faces)) < flipped_share
    faces[flipped] = faces[flipped, ::-1]
    found = oriented(Mesh(np.asarray(ball.vertices), faces))
    assert outward_share(found) == 1
    np.testing.assert_array_equal(np.sort(found.faces, axis=1), np.sort(faces, axis=1))
    np.testing.assert_array_equal(oriented(found).faces, found.faces)
