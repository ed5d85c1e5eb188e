"""Tests of connected parts and closedness."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from polarsim.geometry.topology import is_watertight, open_edges, part_of_vertex

TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])


def test_a_tetrahedron_is_closed_until_a_face_is_missing_or_flipped_or_doubled():
    assert is_watertight(TETRAHEDRON)
    assert not is_watertight(TETRAHEDRON[1:])
    assert not is_watertight(np.concatenate([TETRAHEDRON[:1, ::-1], TETRAHEDRON[1:]]))
    assert not is_watertight(np.concatenate([TETRAHEDRON, TETRAHEDRON[:1]]))
    assert not is_watertight(np.zeros((0, 3), int))


@given(st.permutations(range(4)), st.sets(st.integers(0, 3)))
def test_open_edges_border_missing_faces(order, missing):
    faces = np.asarray(order)[TETRAHEDRON]
    kept = np.delete(faces, sorted(missing), axis=0)
    neighbours = {tuple(edge) for face in kept for edge in zip(face, np.roll(face, -1), strict=True)}
    expected = {(a, b) for a, b in neighbours if (b, a) not in neighbours}
    assert {tuple(edge) for edge in open_edges(kept).tolist()} == expected
    assert bool(expected) == (0 < len(missing) < 4)


@given(st.permutations(range(8)), st.integers(0, 3))
def test_parts_do_not_depend_on_vertex_numbers_and_unused_vertices_are_separate(order, loose):
    two = np.asarray(order)[np.concatenate([TETRAHEDRON, TETRAHEDRON + 4])]
    part = part_of_vertex(two, 8 + loose)
    assert is_watertight(two)
    first, second = set(part[np.asarray(order)[:4]]), set(part[np.asarray(order)[4:]])
    assert len(first) == len(second) == 1
    assert len(first | second | set(part[8:])) == 2 + loose
