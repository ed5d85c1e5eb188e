"""Calibration of confidences: a calibrated confidence is the probability that a detection is correct."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize
from scipy.special import expit, logit, xlogy

from polarsim.detect import metrics

_MIN_IOU = np.array([0.5])  # minimum IoU of a true positive
_MIN_CONFIDENCE = 1e-4  # confidences are clipped to this and 1 minus this, so that logits are finite
_MIN_RATED, _BINS = 0.05, 10  # minimum confidence and number of bins of the calibration error
_PRIOR = 2.0  # weight of the prior on slope 1 and offset 0, in numbers of boxes, for classes with few boxes
Calibration = tuple[tuple[float, float], ...]  # slope and offset of the logit, by class


def calibrate_boxes(boxes: np.ndarray, calibration: Calibration) -> np.ndarray:
    """Return boxes (n, 6) of a detector with calibrated confidences; unchanged without a calibration."""
    if not calibration:
        return boxes
    slope, offset = np.array(calibration)[boxes[:, 5].astype(int)].T
    changed = boxes.copy()
    changed[:, 4] = expit(slope * _logits(boxes[:, 4]) + offset)
    return changed


def fit_calibration(labels: Sequence[tuple[np.ndarray, np.ndarray]], detections: Sequence[np.ndarray]) -> Calibration:
    """Fit slope and offset of the logit of confidences by class, by maximum likelihood (Platt, 1999).

    A class without detections keeps its confidences. Labels are classes (n,) and boxes (n, 4) of each image. The images
    must show places that the detector was not trained on.
    """
    fitted = []
    for ranked in metrics.rank_classes(labels, detections, _MIN_IOU):
        score, right = _logits(ranked.confidence), ranked.right[0, 0].astype(float)

        def loss(values: np.ndarray, score: np.ndarray = score, right: np.ndarray = right) -> float:
            slope, offset = values
            share = np.clip(expit(np.exp(slope) * score + offset), _MIN_CONFIDENCE, 1 - _MIN_CONFIDENCE)
            likelihood = xlogy(right, share) + xlogy(1 - right, 1 - share)
            return float(-likelihood.sum() + _PRIOR * (slope**2 + offset**2))

        slope, offset = minimize(loss, np.zeros(2), method="Nelder-Mead").x
        fitted.append((round(float(np.exp(slope)), 4), round(float(offset), 4)))
    return tuple(fitted)


def calibration_error(
    labels: Sequence[tuple[np.ndarray, np.ndarray]],
    detections: Sequence[np.ndarray],
) -> float:
    """Return the expected calibration error over all classes: mean of |precision - mean confidence|.

    The mean is over bins of equal width, weighted by the number of boxes with a confidence of at least 0.05 (Naeini et
    al., AAAI 2015). NaN without such a box.
    """
    parts = metrics.rank_classes(labels, detections, _MIN_IOU)
    confidence = np.concatenate([ranked.confidence for ranked in parts])
    right = np.concatenate([ranked.right[0, 0] for ranked in parts])
    kept = confidence >= _MIN_RATED
    if not kept.any():
        return float("nan")
    confidence, right = confidence[kept], right[kept]
    number = np.minimum((confidence * _BINS).astype(int), _BINS - 1)
    gaps = np.bincount(number, right - confidence, _BINS)  # sum over each bin
    return float(np.abs(gaps).sum() / len(confidence))


def _logits(confidence: np.ndarray) -> np.ndarray:
    return np.asarray(logit(np.clip(confidence, _MIN_CONFIDENCE, 1 - _MIN_CONFIDENCE)))
