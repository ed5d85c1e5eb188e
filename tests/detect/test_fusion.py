"""Fusion of the boxes of several detectors."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from polarsim.detect.fusion import fuse
from polarsim.detect.nms import suppress_by_class
from polarsim.geometry import boxes

FEW = settings(max_examples=30)
LIMIT, MOST = 0.5, 300
NOTHING = np.zeros((0, 6))


def one(x0, confidence, kind=0, side=100.0):
    return np.array([[x0, 0, x0 + side, side, confidence, kind]], float)


@st.composite
def finds(draw):
    """Strategy of detector boxes (n, 6): many overlapping boxes, some with equal confidences."""
    count = draw(st.integers(0, 12))
    reach = 60.0 if draw(st.booleans()) else 2000.0
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    low = random.uniform(0, reach, (count, 2))
    sure = random.integers(1, 10, count) / 10 if draw(st.booleans()) else random.uniform(0.01, 1, count)
    return np.column_stack([low, low + random.uniform(20, 120, (count, 2)), sure, random.integers(0, 2, count)])


def suppressed(found):
    return suppress_by_class(found, LIMIT, MOST)


@FEW
@given(finds(), st.integers(1, 4))
def test_merging_a_list_with_itself_changes_nothing(found, times):
    own = suppressed(found)
    merged = fuse([own] * times, LIMIT, MOST)
    assert len(merged) == len(own)
    np.testing.assert_array_equal(merged[:, :4], in_order(own)[:, :4])
    np.testing.assert_allclose(merged[:, 4], in_order(own)[:, 4], rtol=1e-12)


def in_order(rows):
    """Sort boxes like merged lists: by descending confidence, class and corners."""
    return rows[np.lexsort((*rows[:, 3::-1].T, rows[:, 5], -rows[:, 4]))]


@FEW
@given(st.lists(finds(), min_size=2, max_size=4), st.randoms(use_true_random=False))
def test_the_order_of_detectors_does_not_matter(found, random):
    shuffled = random.sample(found, len(found))
    np.testing.assert_array_equal(fuse(found, LIMIT, MOST), fuse(shuffled, LIMIT, MOST))


@FEW
@given(finds(), st.integers(1, 3))
def test_a_box_of_a_single_detector_keeps_a_share_of_its_confidence(found, others):
    own = suppressed(found)
    merged = fuse([own, *[NOTHING] * others], LIMIT, MOST)
    np.testing.assert_array_equal(merged[:, :4], in_order(own)[:, :4])
    np.testing.assert_allclose(merged[:, 4], in_order(own)[:, 4] / (1 + others), rtol=1e-12)


@FEW
@given(st.lists(finds(), min_size=1, max_size=4), st.integers(1, 20))
def test_the_merged_list_is_sorted_suppressed_and_limited(found, most):
    merged = fuse(found, LIMIT, most)
    assert len(merged) <= most
    assert (np.diff(merged[:, 4]) <= 0).all()
    assert ((merged[:, 4] > 0) & (merged[:, 4] <= 1)).all()
    for kind in (0, 1):
        own = merged[merged[:, 5] == kind, :4]
        assert (boxes.iou(own, own) - np.eye(len(own)) <= LIMIT + 1e-9).all()


def test_the_merged_box_is_the_mean_by_confidence():
    """Boxes at 0 and 10 px, confidences 0.9 and 0.3: (0.9 * 0 + 0.3 * 10) / 1.2 = 2.5 px, confidence 1.2 / 2."""
    merged = fuse([one(0, 0.9), one(10, 0.3)], LIMIT, MOST)
    np.testing.assert_allclose(merged, [[2.5, 0, 102.5, 100, 0.6, 0]])


def test_a_detector_counts_once_in_a_group():
    """Of two boxes of a detector in a group, only the maximum confidence counts: 0.4 + 0.4 is less than 0.6."""
    twice = np.vstack([one(-20, 0.4), one(20, 0.4)])
    assert boxes.iou(twice[:1, :4], twice[1:, :4])[0, 0] < LIMIT
    merged = fuse([one(0, 0.6), twice], LIMIT, MOST)
    np.testing.assert_allclose(merged, [[0, 0, 100, 100, 0.5, 0]])


def test_a_rock_and_its_shadow_are_not_merged():
    merged = fuse([one(0, 0.9), one(0, 0.8, kind=1)], LIMIT, MOST)
    np.testing.assert_allclose(merged[:, 4:], [[0.45, 0], [0.4, 1]])


def test_chains_of_boxes_are_grouped_around_the_most_confident_box():
    """a and c overlap b by 0.6 and each other by 0.33: around b they form a group, around a the box c is separate."""
    a, b, c = one(0, 0.5), one(25, 0.5), one(50, 0.5)
    b[0, 4] = 0.9
    assert len(fuse([a, b, c], LIMIT, MOST)) == 1
    a[0, 4], b[0, 4] = 0.9, 0.5
    merged = fuse([a, b, c], LIMIT, MOST)
    np.testing.assert_allclose(merged[:, 0], [25 * 0.5 / 1.4, 50])


@pytest.mark.parametrize("found", [[NOTHING], [NOTHING, NOTHING]])
def test_empty_lists_merge_to_an_empty_list(found):
    assert fuse(found, LIMIT, MOST).shape == (0, 6)


def test_a_box_without_area_forms_its_group():
    flat = one(0, 0.9, side=0.0)
    assert len(fuse([np.vstack([flat, one(0, 0.8)]), flat], LIMIT, MOST)) >= 2
