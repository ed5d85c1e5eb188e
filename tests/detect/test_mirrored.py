"""Inference on images and mirrored images."""

import cv2
import numpy as np
import pytest

from polarsim.detect import detectors
from polarsim.detect.mirrored import detect_with_mirror, segment_with_mirror
from polarsim.detect.options import PACKAGED, PredictionOptions


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
