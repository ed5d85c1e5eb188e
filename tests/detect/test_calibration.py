"""A calibrated confidence is the probability of a true positive."""

import numpy as np
import pytest

from polarsim.detect.calibration import calibrate_boxes, calibration_error, fit_calibration

BOX = np.array([10.0, 10, 50, 50])
FAR = np.array([200.0, 200, 240, 240])


def pictures(confidences, share, random, kind=0):
    """Return an image per confidence with a box that is correct with probability `share(confidence)`."""
    labels, found = [], []
    for confidence in confidences:
        right = random.random() < share(confidence)
        labels.append((np.array([kind]), BOX[None]))
        found.append(np.array([[*(BOX if right else FAR), confidence, kind]]))
    return labels, found


@pytest.mark.parametrize("slope", [0.5, 2.0])
def test_overconfident_and_underconfident_detectors_are_calibrated(slope):
    random = np.random.default_rng(3)

    def share(confidence):
        return 1 / (1 + np.exp(-slope * np.log(confidence / (1 - confidence)) + 0.7))

    labels, found = pictures(random.uniform(0.05, 0.95, 2000), share, random)
    (fitted, offset), _ = fit_calibration(labels, found)
    assert fitted == pytest.approx(slope, rel=0.15)
    assert offset == pytest.approx(-0.7, abs=0.15)
    others = pictures(random.uniform(0.05, 0.95, 2000), share, random)
    before, after = (
        calibration_error(others[0], rows)
        for rows in (others[1], [calibrate_boxes(row, ((fitted, offset),)) for row in others[1]])
    )
    assert after < 0.03 < before


def test_calibration_keeps_boxes_and_their_order_within_a_class():
    rows = np.array([[*BOX, 0.9, 0], [*FAR, 0.4, 1], [*FAR, 0.2, 0]])
    changed = calibrate_boxes(rows, ((1.7, -0.5), (1.0, 0.0)))
    assert np.array_equal(changed[:, [0, 1, 2, 3, 5]], rows[:, [0, 1, 2, 3, 5]])
    assert changed[0, 4] > changed[2, 4]
    assert changed[1, 4] == pytest.approx(0.4)
    assert calibrate_boxes(rows, ()) is rows


def test_the_error_of_calibration_by_hand():
    """Two boxes of 0.92 with one true positive, two boxes of 0.32 with none: (2 * 0.42 + 2 * 0.32) / 4."""
    label = [(np.array([0]), BOX[None])] * 4
    found = [
        np.array([[*box, confidence, 0]])
        for box, confidence in zip([BOX, FAR, FAR, FAR], [0.92] * 2 + [0.32] * 2, strict=True)
    ]
    assert calibration_error(label, found) == pytest.approx(0.37)
    assert np.isnan(calibration_error(label, [np.zeros((0, 6))] * 4))


def test_a_class_without_detections_keeps_its_confidences():
    _, kept = fit_calibration([(np.array([0]), BOX[None])], [np.array([[*BOX, 0.5, 0]])])
    assert kept == pytest.approx((1, 0), abs=1e-3)
