import numpy as np
import pytest
import trimesh

from polarsim.geometry.meshes import Mesh
from polarsim.geometry.topology import is_watertight, part_of_face
from polarsim.rocks.solids import PARTING, split_non_manifold, volume


def joined(*boxes):
    """Return boxes (low corner, high corner) with common vertices at their contact."""
    bodies = [trimesh.creation.box(bounds=box) for box in boxes]
    whole = trimesh.util.concatenate(bodies)
    whole.merge_vertices()
    return Mesh(np.asarray(whole.vertices, float), np.asarray(whole.faces, np.int64))


@pytest.mark.parametrize("far", [(2, 2, 1), (2, 2, 2)], ids=["edge", "vertex"])
def test_two_boxes_that_touch_become_two_solids(far):
    low = np.array(far) - 1
    touching = joined([(0, 0, 0), (1, 1, 1)], [tuple(low), far])
    apart = split_non_manifold(touching)
    assert is_watertight(apart.faces)
    assert part_of_face(apart.faces).max() == 1
    assert volume(apart) == pytest.approx(2, abs=20 * PARTING)
    # They remain separate after the rounding of a file, even if its reader merges equal vertices.
    assert len(np.unique(np.round(apart.vertices, 6), axis=0)) == len(apart.vertices)


def test_a_manifold_solid_is_not_changed():
    box = joined([(0, 0, 0), (1, 1, 1)])
    assert split_non_manifold(box) is box


def test_coincident_faces_are_closed():
    # Two boxes with a common face that is cut along different diagonals: no volume between them, no common edge.
    one, other = (trimesh.creation.box(bounds=[(x, 0, 0), (x + 1, 1, 1)]) for x in (0, 1))
    other.apply_transform(trimesh.transformations.reflection_matrix([1.5, 0.5, 0.5], [0, 1, 0]))
    whole = trimesh.util.concatenate([one, other])
    whole.merge_vertices()
    apart = split_non_manifold(Mesh(np.asarray(whole.vertices, float), np.asarray(whole.faces, np.int64)))
    assert is_watertight(apart.faces)
    assert volume(apart) == pytest.approx(2, abs=1e-3)


def test_a_ball_with_pinched_vertices_is_repaired(rng):
    ball = trimesh.creation.icosphere(3)
    number = np.arange(len(ball.vertices))
    for one, other in rng.choice(len(number), (6, 2), replace=False):
        number[number == number[other]] = number[one]  # distant vertices are merged: the surface touches itself
    apart = split_non_manifold(Mesh(np.asarray(ball.vertices, float), number[np.asarray(ball.faces, np.int64)]))
    assert is_watertight(apart.faces)
    assert len(np.unique(apart.faces)) == len(ball.vertices)
