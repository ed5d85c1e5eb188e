import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.geometry.boxes import (
    area,
    box_around_points,
    box_centres,
    box_of_ellipse,
    box_of_mask,
    clip,
    iou,
    largest_covered_share,
    match_by_distance,
    match_by_iou,
    match_by_position_and_size,
    match_pairs,
    pixel_window,
    rotated_box,
)

SQUARE = np.array([[0.0, 0, 10, 10]])


@pytest.mark.parametrize(
    ("other", "expected"),
    [
        ([0, 0, 10, 10], 1),
        ([5, 0, 15, 10], 50 / 150),  # overlap of half of each box
        ([5, 5, 15, 15], 25 / 175),
        ([2, 2, 4, 4], 4 / 100),
        ([10, 0, 20, 10], 0),  # they touch
        ([30, 30, 40, 40], 0),
        ([5, 5, 5, 5], 0),  # empty
    ],
)
def test_iou_of_two_boxes(other, expected):
    assert iou(SQUARE, np.array([other], float))[0, 0] == pytest.approx(expected)


def test_a_box_inside_a_larger_box_is_covered():
    label = np.array([[300.0, 350, 400, 450]])
    boxes = np.array([[310.0, 360, 330, 380], [0, 0, 1900, 1200], [395, 350, 495, 450], [500, 350, 600, 450]])
    np.testing.assert_allclose(largest_covered_share(boxes, label), [1, 1, 0.05, 0])
    assert largest_covered_share(boxes, label[:0]).tolist() == [0, 0, 0, 0]


OVERLAP = np.array([[1.0, 0.6], [0.6, 0.0]])  # the best pair leaves row 1 unmatched


def distances(boxes, others):
    return np.linalg.norm(box_centres(boxes)[:, None] - box_centres(others)[None], axis=-1)


@pytest.mark.parametrize(
    ("objective", "found"),
    [("most", {(0, 1), (1, 0)}), ("sum", {(0, 1), (1, 0)}), ("greedy", {(0, 0)})],
)
def test_objectives_prefer_many_pairs_or_good_pairs(objective, found):
    rows, columns = match_pairs(OVERLAP, OVERLAP > 0, objective)
    assert set(zip(rows.tolist(), columns.tolist(), strict=True)) == found


@pytest.mark.parametrize(("objective", "count"), [("most", 2), ("sum", 1)])
def test_the_largest_sum_may_be_a_single_pair(objective, count):
    score = np.array([[1.0, 0.4], [0.4, 0.0]])
    assert len(match_pairs(score, score > 0, objective)[0]) == count


@pytest.mark.parametrize("objective", ["most", "sum", "greedy"])
@pytest.mark.parametrize("shape", [(0, 3), (3, 0), (2, 2)])
def test_nothing_allowed_gives_no_pairs(objective, shape):
    rows, columns = match_pairs(np.full(shape, np.nan), np.zeros(shape, bool), objective)
    assert len(rows) == len(columns) == 0


MATCHERS = {  # matching function, maximised score, and allowed pairs
    "match": (lambda a, b: match_by_iou(iou(a, b)), iou, lambda a, b: iou(a, b) >= 0.5),
    "match_nearest": (
        lambda a, b: match_by_distance(a, b, 40),
        lambda a, b: iou(a, b) - distances(a, b) / 40,
        lambda a, b: (distances(a, b) <= 40) | (iou(a, b) >= 0.2),
    ),
    "assign": (
        lambda a, b: match_by_position_and_size(a, b, 40),
        lambda a, b: -distances(a, b) / 40 + iou(a, b) / 2,
        None,
    ),
}


@pytest.mark.parametrize("name", MATCHERS)
@given(seed=st.integers(0, 2**32 - 1))
def test_no_other_pairing_is_better(name, seed):
    """Compare with all permutations of three boxes of equal size, for which assign depends only on the gate."""
    matcher, score, allowed = MATCHERS[name]
    random = np.random.default_rng(seed)
    a, b = (np.hstack([corner, corner + 50]) for corner in random.uniform(0, 90, (2, 3, 2)))
    rows, columns = matcher(a, b)
    value, may = score(a, b), (allowed(a, b) if allowed else distances(a, b) <= 40)

    def worth(order):
        good = [value[row, column] for row, column in enumerate(order) if may[row, column]]
        return len(good), sum(good)

    best = max(worth(order) for order in itertools.permutations(range(3)))
    assert may[rows, columns].all()
    assert (len(rows), value[rows, columns].sum()) == (best[0], pytest.approx(best[1]))


def test_boxes_are_cut_at_the_border_of_the_photo():
    cut = clip(np.array([[-5.0, -5, 10, 10], [1930, 1200, 1950, 1230], [2000, 0, 2010, 5]]), 1936, 1216)
    np.testing.assert_array_equal(cut, [[0, 0, 10, 10], [1930, 1200, 1936, 1216], [1936, 0, 1936, 5]])
    np.testing.assert_array_equal(area(cut), [100, 96, 0])


def test_the_box_of_one_pixel_is_one_pixel_wide():
    mask = np.zeros((5, 8), bool)
    mask[2, 3] = True
    np.testing.assert_array_equal(box_of_mask(mask), [3, 2, 4, 3])
    assert box_of_mask(np.zeros((5, 8), bool)) is None


@given(st.lists(st.floats(-60, 160), min_size=4, max_size=4), st.floats(0, 20))
def test_a_window_contains_the_pixels_that_an_enlarged_box_touches(edges, margin):
    width, height = 80, 100
    box = np.array([*np.minimum(edges[:2], edges[2:]), *np.maximum(edges[:2], edges[2:])])
    rows, columns = pixel_window(box, np.full(2, margin), width, height)
    x, y = np.meshgrid(np.arange(width), np.arange(height))  # pixels extend from x to x + 1
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
    expected = box_around_points(corners @ np.array([[cos, sin], [-sin, cos]]) + [left + width / 2, top + height / 2])
    box = np.array([left, top, left + width, top + height])
    np.testing.assert_allclose(rotated_box(box, angle), expected, atol=1e-6)
    np.testing.assert_allclose(rotated_box(box, -angle), expected, atol=1e-6)


@given(centre=st.tuples(LENGTHS, LENGTHS), radii=st.tuples(LENGTHS, LENGTHS), angle=ANGLES)
def test_the_box_around_an_ellipse_holds_its_points_and_touches_them(centre, radii, angle):
    around_it = np.radians(np.arange(0, 360, 0.1))
    points = np.stack([radii[0] * np.cos(around_it), radii[1] * np.sin(around_it)], axis=1)
    cos, sin = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    expected = box_around_points(points @ np.array([[cos, sin], [-sin, cos]]) + centre)
    box = box_of_ellipse(np.array(centre), np.array(radii), angle)
    np.testing.assert_allclose(box, expected, atol=1e-3 * max(radii))
