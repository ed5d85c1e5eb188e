import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from polarsim.geometry import bvh

coordinates = st.floats(-100, 100, width=32)


@st.composite
def triangles(draw):
    """Return vertices and faces with coarse coordinates, so that many centres and triangles coincide."""
    count = draw(st.integers(1, 60))
    coarse = st.integers(-2, 2).map(float)
    values = draw(st.sampled_from([coarse, coordinates]))
    return draw(arrays.arrays(np.float64, (3 * count, 3), elements=values)), np.arange(3 * count).reshape(-1, 3)


def walked(tree):
    """Yield (depth, low, high, code) of each child, from the root."""
    left = [(0, 0)]
    while left:
        node, depth = left.pop()
        for side in range(2):
            code = int(tree.children[node, side])
            yield depth + 1, *tree.boxes[node, 2 * side : 2 * side + 2], code
            if code >= 0:
                left.append((code, depth + 1))


def points(code):
    first, count = ~code >> bvh.COUNT_BITS, ~code & ((1 << bvh.COUNT_BITS) - 1)
    return np.arange(first, first + count)


@settings(max_examples=60, deadline=None)
@given(triangles())
def test_every_triangle_is_once_in_a_small_leaf_with_tight_boxes(scene):
    vertices, faces = scene
    tree, again = bvh.build_tree(vertices, faces), bvh.build_tree(vertices, faces)
    nodes = list(walked(tree))
    in_leaves = np.concatenate([points(code) for *_, code in nodes if code < 0])
    np.testing.assert_array_equal(np.sort(in_leaves), np.arange(len(faces)))
    np.testing.assert_array_equal(np.sort(tree.order), np.arange(len(faces)))
    assert sorted(code for *_, code in nodes if code >= 0) == list(range(1, len(tree.children)))
    corners = vertices.astype(np.float32)[faces[tree.order]]
    for depth, low, high, code in nodes:
        inside = tree.boxes[code] if code >= 0 else corners[points(code)].reshape(-1, 3)
        assert (inside >= low).all()
        assert (inside <= high).all()
        assert depth <= bvh.LEVELS
        assert code >= 0 or len(points(code)) <= bvh.LEAF
    for name in ("boxes", "children", "order"):
        np.testing.assert_array_equal(getattr(tree, name), getattr(again, name))


def test_too_deep_trees_are_halved(monkeypatch):
    count = 300
    centres = 2.0 ** -np.arange(count)[:, None] * 1e30  # each cut separates few triangles
    vertices = (centres[:, None] * np.array([[1, 0, 0], [1.1, 0, 0], [1, 0.1, 0]])).reshape(-1, 3)
    faces = np.arange(3 * count).reshape(-1, 3)
    deep = max(depth for depth, *_ in walked(bvh.build_tree(vertices, faces)))
    monkeypatch.setattr(bvh, "LEVELS", 8)
    shallow = max(depth for depth, *_ in walked(bvh.build_tree(vertices, faces)))
    assert shallow <= 8 < deep


def test_an_empty_mesh_is_refused():
    with pytest.raises(ValueError, match="triangles"):
        bvh.build_tree(np.zeros((0, 3)), np.zeros((0, 3), int))
