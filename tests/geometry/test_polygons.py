import hypothesis.extra.numpy as arrays
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import Polygon

from polarsim.geometry.polygons import outlines, paint, rasterised, signed_area
from polarsim.photo import GREY_VALUES, POLYGON_CLASSES

BACKGROUND, GROUND, ROCK, SHADOW = (POLYGON_CLASSES.index(name) for name in ("background", "ground", "rock", "shadow"))
any_mask = arrays.arrays(bool, st.tuples(st.integers(1, 12), st.integers(1, 12)))


def covered(rings: list[np.ndarray], shape: tuple[int, int]) -> np.ndarray:
    mask = np.zeros(shape, bool)
    for ring in rings:
        mask |= rasterised(ring, shape)
    return mask


def disc(radius: float, size: int = 80) -> np.ndarray:
    y, x = np.mgrid[:size, :size] + 0.5
    return (x - size / 2) ** 2 + (y - size / 2) ** 2 < radius**2


@settings(deadline=None)
@given(mask=any_mask)
def test_outlines_enclose_exactly_the_pixels_of_any_mask(mask):
    np.testing.assert_array_equal(covered(outlines(mask), mask.shape), mask)


@settings(deadline=None)
@given(mask=any_mask, simplify_px=st.sampled_from([0.0, 0.6, 2.0]))
def test_rings_are_simple_and_run_clockwise(mask, simplify_px):
    for ring in outlines(mask, simplify_px):
        assert Polygon(ring).is_valid
        assert signed_area(ring) > 0
        assert not np.array_equal(ring[0], ring[-1])


@st.composite
def slivers(draw):
    """Return a mask of thin slanted ellipses, similar to shadows."""
    y, x = np.mgrid[:50, :70] + 0.5
    mask = np.zeros(x.shape, bool)
    for _ in range(draw(st.integers(1, 3))):
        angle, dx, dy = draw(st.floats(0, np.pi)), x - draw(st.floats(10, 60)), y - draw(st.floats(10, 40))
        along, across = np.cos(angle) * dx + np.sin(angle) * dy, np.cos(angle) * dy - np.sin(angle) * dx
        mask |= (along / draw(st.floats(3, 40))) ** 2 + (across / draw(st.floats(0.6, 9))) ** 2 < 1
    return mask


@settings(deadline=None)
@given(mask=slivers() | any_mask, simplify_px=st.sampled_from([0.3, 0.6, 2.0, 5.0]))
def test_simplified_outlines_keep_98_percent_of_any_mask(mask, simplify_px):
    rings = outlines(mask, simplify_px)
    in_a_file = [(ring / [1936, 1216]).round(6) * [1936, 1216] for ring in rings]
    for found in (rings, in_a_file):
        back = covered(found, mask.shape)
        assert (back & mask).sum() >= 0.98 * (back | mask).sum()


def test_simplifying_a_large_disc_halves_its_points():
    mask = disc(35)
    assert len(outlines(mask, 0.6)[0]) < len(outlines(mask)[0]) / 2


def test_a_ring_shaped_region_becomes_pieces_without_a_hole():
    mask = disc(30) & ~disc(12)
    rings = outlines(mask, 0.6)
    back = covered(rings, mask.shape)
    assert len(rings) >= 2
    assert not back[40, 40]
    assert (back & mask).sum() / (back | mask).sum() >= 0.98


def test_a_rectangle_is_outlined_along_its_pixel_centres_border():
    mask = np.zeros((10, 10), bool)
    mask[2:5, 3:9] = True  # columns 3 to 8, rows 2 to 4; marching squares cuts the corners of corner pixels
    (ring,) = outlines(mask)
    np.testing.assert_allclose([ring.min(axis=0), ring.max(axis=0)], [[3, 2], [9, 5]])
    assert signed_area(ring) == pytest.approx(6 * 3 - 4 * 0.125)


def test_a_triangle_covers_the_pixel_centres_inside_it():
    # By hand: centres (0.5, 0.5), (1.5, 0.5), (0.5, 1.5) are below x + y = 2.8, (1.5, 1.5) and (2.5, 0.5) are not.
    mask = rasterised(np.array([[0, 0], [2.8, 0], [0, 2.8]]), (4, 4))
    assert sorted(zip(*np.nonzero(mask), strict=True)) == [(0, 0), (0, 1), (1, 0)]


def test_parts_outside_the_picture_are_cut():
    mask = rasterised(np.array([[-5, -5], [2, -5], [2, 2], [-5, 2]], float), (4, 4))
    assert mask.sum() == 4


def test_an_empty_mask_has_no_outline():
    assert outlines(np.zeros((3, 4), bool)) == []


def test_rocks_are_painted_last_whatever_the_order_in_the_file():
    def square(a, b):
        return np.array([[a, a], [b, a], [b, b], [a, b]], float)

    polygons = [(ROCK, square(4, 6)), (SHADOW, square(3, 7)), (BACKGROUND, square(0, 10)), (GROUND, square(1, 9))]
    grey = paint(polygons, (10, 10))
    expected = [GREY_VALUES[name] for name in ("background", "ground", "shadow", "rock")]
    assert [grey[k, k] for k in (0, 1, 3, 4)] == expected
    np.testing.assert_array_equal(grey, paint(polygons[::-1], (10, 10)))
