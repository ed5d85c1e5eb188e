import hypothesis.extra.numpy as arrays
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import label

from polarsim.labels.shapes import (
    MaskShape,
    convex_shape,
    fit_shape,
    mask_shapes,
    stretch_shape,
    superellipse,
    visible_parts,
)

any_shape = st.builds(
    MaskShape,
    arrays.arrays(bool, st.tuples(st.integers(1, 6), st.integers(1, 6))),
    st.integers(-4, 10),
    st.integers(-4, 8),
)


def test_a_stretched_shape_fills_its_new_box():
    y, x = np.mgrid[:40, :60] + 0.5
    ellipse = MaskShape(((x - 30) / 30) ** 2 + ((y - 20) / 20) ** 2 < 1, 100, 200)
    box = np.array([310.4, 120.0, 400.4, 180.0])
    found = stretch_shape(ellipse, box)
    np.testing.assert_allclose(found.box, box, atol=1)
    assert found.mask.sum() == pytest.approx(np.pi * 45 * 30, rel=0.02)


def test_a_shape_can_be_stretched_partially():
    own = MaskShape(np.ones((20, 40), bool), 100, 200)
    np.testing.assert_array_equal(fit_shape(own, np.array([110.0, 200, 150, 230]), 0.3).box, [107, 200, 147, 227])


def test_a_convex_shape_has_no_dents_and_its_old_box():
    dented = np.zeros((9, 9), bool)
    dented[:, 0] = dented[8] = True
    found = convex_shape(MaskShape(dented, 4, 5))
    np.testing.assert_array_equal(found.mask, np.tri(9, dtype=bool))
    np.testing.assert_array_equal(found.box, [4, 5, 13, 14])


def test_a_rounded_shape_fills_its_box():
    box = np.array([10.0, 20, 40, 36])
    np.testing.assert_allclose(superellipse(box).box, box)
    assert np.pi / 4 < superellipse(box).mask.mean() < 1


def test_a_shape_covers_the_pixels_of_its_rock():
    ids = np.full((6, 8), -1)
    ids[2:4, 3:7] = 5
    ids[0, 0] = 0
    found = mask_shapes(ids)
    assert set(found) == {0, 5}
    np.testing.assert_array_equal(found[5].box, [3, 2, 7, 4])
    assert found[5].mask.all()


@pytest.mark.parametrize("own", [None, MaskShape(np.ones((4, 4), bool), 200, 200)])
def test_a_label_far_from_its_mesh_gets_a_rounded_box(own):
    box = np.array([10.0, 20, 40, 36])
    np.testing.assert_array_equal(fit_shape(own, box).mask, superellipse(box).mask)


def test_a_shape_has_neither_holes_nor_small_components():
    ids = np.full((20, 30), -1)
    ids[2:12, 3:13] = 5
    ids[5:7, 6:9] = -1
    ids[4, 25] = 5
    found = mask_shapes(ids)[5]
    np.testing.assert_array_equal(found.box, [3, 2, 13, 12])
    assert found.mask.all()


def test_a_rock_in_two_large_parts_keeps_both():
    ids = np.full((20, 30), -1)
    ids[2:12, 3:9] = 5
    ids[2:12, 14:18] = 5
    found = mask_shapes(ids)[5]
    np.testing.assert_array_equal(found.box, [3, 2, 18, 12])
    assert found.mask.sum() == 100


@settings(deadline=None)
@given(shapes=st.lists(any_shape, max_size=5))
def test_visible_parts_are_not_covered_by_later_shapes(shapes):
    expected = [[-1] * 10 for _ in range(8)]  # pixel by pixel
    for number, shape in enumerate(shapes):
        for row, column in zip(*np.nonzero(shape.mask), strict=True):
            y, x = row + shape.top, column + shape.left
            if 0 <= x < 10 and 0 <= y < 8:
                expected[y][x] = number
    parts = visible_parts(shapes, 10, 8)
    for number, part in enumerate(parts):
        own = np.array(expected) == number
        shown = np.zeros((8, 10), bool)
        if part is not None:
            shown[part.window] = part.mask
        pieces, count = label(own)  # scipy, connectivity 4
        sizes = [(pieces == piece).sum() for piece in range(1, count + 1)]
        kept = [piece for piece, size in enumerate(sizes, 1) if size >= 0.15 * max(sizes)]
        np.testing.assert_array_equal(shown, np.isin(pieces, kept))
        assert (part is None) == (not own.any())
