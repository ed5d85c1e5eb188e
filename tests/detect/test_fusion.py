"""Fusion of the boxes of several detectors, and of an image and the mirrored image."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from polarsim.detect import detectors
from polarsim.detect.detectors.models import detect_with_mirror, segment_with_mirror
from polarsim.detect.fusion import fuse
from polarsim.detect.nms import suppress_by_class
from polarsim.detect.options import PACKAGED, PredictionOptions
from polarsim.geometry import boxes

FEW = settings(max_examples=15)
LIMIT = 0.5
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


@FEW
@given(finds(), st.integers(1, 4))
def test_merging_a_list_with_itself_changes_nothing(found, times):
    own = suppress_by_class(found, LIMIT)
    merged = fuse([own] * times, LIMIT)
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
    np.testing.assert_array_equal(fuse(found, LIMIT), fuse(shuffled, LIMIT))


@FEW
@given(finds(), st.integers(1, 3))
def test_a_box_of_a_single_detector_keeps_a_share_of_its_confidence(found, others):
    own = suppress_by_class(found, LIMIT)
    merged = fuse([own, *[NOTHING] * others], LIMIT)
    np.testing.assert_array_equal(merged[:, :4], in_order(own)[:, :4])
    np.testing.assert_allclose(merged[:, 4], in_order(own)[:, 4] / (1 + others), rtol=1e-12)


@FEW
@given(st.lists(finds(), min_size=1, max_size=4))
def test_the_merged_list_is_sorted_and_suppressed(found):
    merged = fuse(found, LIMIT)
    assert (np.diff(merged[:, 4]) <= 0).all()
    assert ((merged[:, 4] > 0) & (merged[:, 4] <= 1)).all()
    for kind in (0, 1):
        own = merged[merged[:, 5] == kind, :4]
        assert (boxes.iou(own, own) - np.eye(len(own)) <= LIMIT + 1e-9).all()


def test_the_merged_box_is_the_mean_by_confidence():
    """Boxes at 0 and 10 px, confidences 0.9 and 0.3: (0.9 * 0 + 0.3 * 10) / 1.2 = 2.5 px, confidence 1.2 / 2."""
    merged = fuse([one(0, 0.9), one(10, 0.3)], LIMIT)
    np.testing.assert_allclose(merged, [[2.5, 0, 102.5, 100, 0.6, 0]])


def test_a_detector_counts_once_in_a_group():
    """Of two boxes of a detector in a group, only the maximum confidence counts: 0.4 + 0.4 is less than 0.6."""
    twice = np.vstack([one(-20, 0.4), one(20, 0.4)])
    assert boxes.iou(twice[:1, :4], twice[1:, :4])[0, 0] < LIMIT
    merged = fuse([one(0, 0.6), twice], LIMIT)
    np.testing.assert_allclose(merged, [[0, 0, 100, 100, 0.5, 0]])


def test_a_rock_and_its_shadow_are_not_merged():
    merged = fuse([one(0, 0.9), one(0, 0.8, kind=1)], LIMIT)
    np.testing.assert_allclose(merged[:, 4:], [[0.45, 0], [0.4, 1]])


def test_chains_of_boxes_are_grouped_around_the_most_confident_box():
    """a and c overlap b by 0.6 and each other by 0.33: around b they form a group, around a the box c is separate."""
    a, b, c = one(0, 0.5), one(25, 0.5), one(50, 0.5)
    b[0, 4] = 0.9
    assert len(fuse([a, b, c], LIMIT)) == 1
    a[0, 4], b[0, 4] = 0.9, 0.5
    merged = fuse([a, b, c], LIMIT)
    np.testing.assert_allclose(merged[:, 0], [25 * 0.5 / 1.4, 50])


@pytest.mark.parametrize("found", [[NOTHING], [NOTHING, NOTHING]])
def test_empty_lists_merge_to_an_empty_list(found):
    assert fuse(found, LIMIT).shape == (0, 6)


def test_a_box_without_area_forms_its_group():
    flat = one(0, 0.9, side=0.0)
    assert len(fuse([np.vstack([flat, one(0, 0.8)]), flat], LIMIT)) >= 2


def bright_box(pictures, sees=lambda x0, width: True):
    """Return the box of the bright rectangle of each image, class 0, confidence 0.8, if `sees` accepts the position."""
    found = []
    for picture in pictures:
        rows, columns = np.nonzero(picture > 128)
        box = [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1, 0.8, 0]
        found.append(np.array([box], float)[: int(sees(box[0], picture.shape[1]))])
    return found


@pytest.fixture
def pictures():
    shown = np.zeros((2, 40, 90), np.uint8)
    shown[0, 5:20, 3:23] = 255
    shown[1, 10:30, 60:90] = 255
    return shown


def test_boxes_found_in_both_images_are_unchanged(pictures):
    for own, both in zip(bright_box(pictures), detect_with_mirror(bright_box, 0.5)(pictures), strict=True):
        np.testing.assert_allclose(both, own)


def test_a_box_found_in_a_single_image_keeps_half_of_its_confidence(pictures):
    def half_blind(shown):
        return bright_box(shown, lambda x0, width: x0 > width / 2)  # only boxes that start in the right half

    assert not len(half_blind(pictures)[0])
    for whole, both in zip(bright_box(pictures), detect_with_mirror(half_blind, 0.5)(pictures), strict=True):
        np.testing.assert_allclose(both, whole * [1, 1, 1, 1, 0.5, 1])


def test_masks_are_the_mean_of_both(pictures):
    def by_column(shown):
        """Return rock for the left half of every image."""
        share = np.linspace(0, 1, shown.shape[2], dtype=np.float32)
        return np.broadcast_to(np.stack([1 - share, share])[None, :, None], (len(shown), 2, 1, shown.shape[2]))

    np.testing.assert_allclose(segment_with_mirror(by_column)(pictures), 0.5, atol=1e-6)


def test_a_mirrored_picture_has_the_mirrored_boxes():
    """The predictions do not depend on a left-right bias of the detector."""
    options = PredictionOptions(confidence=0.05, nms_iou=0.5, mirrored=True)
    detect = detectors.load_detector(detectors.read_detector(PACKAGED), PACKAGED.parent, options, 1)
    picture = np.full((160, 256), 70, np.uint8)
    cv2.fillPoly(picture, [np.array([[60, 90], [75, 60], [95, 65], [100, 92]])], 190)  # lit rock
    cv2.fillPoly(picture, [np.array([[100, 92], [95, 70], [170, 88], [160, 96]])], 5)  # shadow
    seen, turned = detect(picture[None])[0], detect(picture[None, :, ::-1].copy())[0]
    assert len(seen)
    turned[:, [0, 2]] = 256 - turned[:, [2, 0]]
    order = [np.lexsort(rows[:, :5].round(2).T) for rows in (seen, turned)]
    np.testing.assert_allclose(seen[order[0]], turned[order[1]], atol=1e-3)
