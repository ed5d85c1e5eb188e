import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from polarsim.geometry.boxes import (
    area,
    around,
    around_ellipse,
    clip,
    iou,
    largest_covered_share,
    match,
    match_sum,
    of_mask,
    turned,
    window,
)

SQUARE = np.array([[0.0, 0, 10, 10]])


@pytest.mark.parametrize(
    ("other", "expected"),
    [
        ([0, 0, 10, 10], 1),
        ([5, 0, 15, 10], 50 / 150),  # half of each is shared
        ([5, 5, 15, 15], 25 / 175),
        ([2, 2, 4, 4], 4 / 100),
        ([10, 0, 20, 10], 0),  # they touch
        ([30, 30, 40, 40], 0),
        ([5, 5, 5, 5], 0),  # empty
    ],
)
def test_overlap_is_the_shared_area_over_the_whole(other, expected):
    assert iou(SQUARE, np.array([other], float))[0, 0] == pytest.approx(expected)


def test_a_box_inside_another_one_is_covered_whichever_is_the_smaller():
    label = np.array([[300.0, 350, 400, 450]])
    boxes = np.array([[310.0, 360, 330, 380], [0, 0, 1900, 1200], [395, 350, 495, 450], [500, 350, 600, 450]])
    np.testing.assert_allclose(largest_covered_share(boxes, label), [1, 1, 0.05, 0])
    assert largest_covered_share(boxes, label[:0]).tolist() == [0, 0, 0, 0]


def test_no_boxes_give_an_empty_table():
    assert iou(np.zeros((0, 4)), SQUARE).shape == (0, 1)
    assert len(match(np.zeros((0, 3)))[0]) == 0


def test_as_many_pairs_as_can_be_count_more_than_one_good_pair():
    # Row 0 fits column 0 perfectly, but then row 1 has nobody; two pairs at 0.6 are better.
    overlap = np.array([[1.0, 0.6], [0.6, 0.0]])
    rows, columns = match(overlap)
    assert sorted(zip(rows.tolist(), columns.tolist(), strict=True)) == [(0, 1), (1, 0)]
    rows, columns = match_sum(np.array([[1.0, 0.4], [0.4, 0.0]]))
    assert list(zip(rows.tolist(), columns.tolist(), strict=True)) == [(0, 0)]


@given(arrays(float, (3, 3), elements=st.sampled_from([0.0, 0.3, 0.5, 0.55, 0.7, 0.9])))
def test_no_other_pairing_is_better(overlap):
    rows, columns = match(overlap)

    def worth(order):
        good = [overlap[row, column] for row, column in enumerate(order) if overlap[row, column] >= 0.5]
        return len(good), sum(good)

    best = max(worth(order) for order in itertools.permutations(range(3)))
    assert len(rows) == best[0]
    assert overlap[rows, columns].sum() == pytest.approx(best[1])


def test_boxes_are_cut_at_the_border_of_the_photo():
    cut = clip(np.array([[-5.0, -5, 10, 10], [1930, 1200, 1950, 1230], [2000, 0, 2010, 5]]))
    np.testing.assert_array_equal(cut, [[0, 0, 10, 10], [1930, 1200, 1936, 1216], [1936, 0, 1936, 5]])
    np.testing.assert_array_equal(area(cut), [100, 96, 0])


def test_a_box_around_points_holds_them_tightly():
    np.testing.assert_array_equal(around(np.array([[3.0, 7], [1, 9], [2, 8]])), [1, 7, 3, 9])


def test_the_box_of_one_pixel_is_one_pixel_wide():
    mask = np.zeros((5, 8), bool)
    mask[2, 3] = True
    np.testing.assert_array_equal(of_mask(mask), [3, 2, 4, 3])
    assert of_mask(np.zeros((5, 8), bool)) is None


@given(st.lists(st.floats(-60, 160), min_size=4, max_size=4), st.floats(0, 20))
def test_a_window_holds_the_pixels_of_the_picture_that_a_widened_box_touches(edges, margin):
    width, height = 80, 100
    box = np.array([*np.minimum(edges[:2], edges[2:]), *np.maximum(edges[:2], edges[2:])])
    rows, columns = window(box, np.full(2, margin), width, height)
    x, y = np.meshgrid(np.arange(width), np.arange(height))  # a pixel reaches from here to one further
    (x0, y0), (x1, y1) = box[:2] - margin, box[2:] + margin
    touched = (x + 1 > x0) & (x < x1) & (y + 1 > y0) & (y < y1)
    held = np.zeros((height, width), bool)
    held[rows, columns] = True
    np.testing.assert_array_equal(held, touched)


LENGTHS, ANGLES = st.floats(1, 500), st.floats(-720, 720)


@given(left=LENGTHS, top=LENGTHS, width=LENGTHS, height=LENGTHS, angle=ANGLES)
def test_a_turned_box_is_the_box_around_its_turned_corners(left, top, width, height, angle):
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]]) - [width / 2, height / 2]
    cos, sin = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    expected = around(corners @ np.array([[cos, sin], [-sin, cos]]) + [left + width / 2, top + height / 2])
    box = np.array([left, top, left + width, top + height])
    np.testing.assert_allclose(turned(box, angle), expected, atol=1e-6)
    np.testing.assert_allclose(turned(box, -angle), expected, atol=1e-6)


@given(centre=st.tuples(LENGTHS, LENGTHS), radii=st.tuples(LENGTHS, LENGTHS), angle=ANGLES)
def test_the_box_around_an_ellipse_holds_its_points_and_touches_them(centre, radii, angle):
    around_it = np.radians(np.arange(0, 360, 0.1))
    points = np.stack([radii[0] * np.cos(around_it), radii[1] * np.sin(around_it)], axis=1)
    cos, sin = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    expected = around(points @ np.array([[cos, sin], [-sin, cos]]) + centre)
    box = around_ellipse(np.array(centre), np.array(radii), angle)
    np.testing.assert_allclose(box, expected, atol=1e-3 * max(radii))
