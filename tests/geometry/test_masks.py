"""IoU of masks, calculated by hand."""

import numpy as np
import pytest

from polarsim.geometry.masks import class_iou, confusion_matrix

TRUTH = np.array([[0, 0, 0, 1], [0, 1, 1, 1], [0, 2, 2, 255]])
FOUND = np.array([[0, 0, 1, 1], [0, 1, 1, 0], [0, 2, 0, 1]])


def test_iou_of_a_case_by_hand():
    counts = confusion_matrix(TRUTH, FOUND, 3)
    np.testing.assert_array_equal(counts, [[4, 1, 0], [1, 3, 0], [1, 0, 1]])  # without the ignored pixel
    np.testing.assert_allclose(class_iou(counts), [4 / 7, 3 / 5, 1 / 2])


def test_iou_is_nan_for_unused_classes_and_zero_for_missed_classes():
    counts = confusion_matrix(np.zeros((2, 2), np.uint8), np.zeros((2, 2), np.uint8), 3)
    np.testing.assert_array_equal(class_iou(counts), [1, np.nan, np.nan])
    missed = confusion_matrix(np.array([0, 2], np.uint8), np.array([0, 0], np.uint8), 3)
    np.testing.assert_array_equal(class_iou(np.stack([counts, missed])), [[1, np.nan, np.nan], [0.5, np.nan, 0]])


def test_masks_of_two_sizes_are_refused():
    with pytest.raises(ValueError, match="shapes"):
        confusion_matrix(np.zeros((2, 2)), np.zeros((2, 3)), 3)
