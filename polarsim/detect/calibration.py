"""Confidences that say how often a detector is right."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize
from scipy.special import expit, logit, xlogy

from polarsim.detect import metrics

_SAME = np.array([0.5])  # IoU from which a box is right
_LEAST = 1e-4  # confidences lie between this and 1 less this: logits stay finite
_PRIOR = 2.0  # boxes that speak for a slope of 1 and an offset of 0: a few boxes do not set these two numbers at will
Calibration = tuple[tuple[float, float], ...]  # slope and offset of the logit, by class


def calibrated(found: np.ndarray, calibration: Calibration) -> np.ndarray:
    """Boxes (n, 6), as a detector gives them, with calibrated confidences; without a calibration as they are."""
    if not calibration:
        return found
    slope, offset = np.array(calibration)[found[:, 5].astype(int)].T
    changed = found.copy()
    changed[:, 4] = expit(slope * _logits(found[:, 4]) + offset)
    return changed


def fit_calibration(labels: Sequence[tuple[np.ndarray, np.ndarray]], found: Sequence[np.ndarray]) -> Calibration:
    """Slope and offset of the logit of confidences, by class, with which they are most likely (Platt, 1999).

    A class of which nothing was found keeps its confidences.

    Parameters
    ----------
    labels : sequence of (classes (n,), boxes (n, 4))
        Of every picture, as in `sizes.choose_sizes`: of places that the detector was not trained on.
    found : sequence of (n, 6)
        x0, y0, x1, y1, confidence, class.
    """
    fitted = []
    for ranked in metrics.rank_classes(labels, found, _SAME):
        score, right = _logits(ranked.confidence), ranked.right[0, 0].astype(float)

        def loss(values: np.ndarray, score: np.ndarray = score, right: np.ndarray = right) -> float:
            slope, offset = values
            share = np.clip(expit(np.exp(slope) * score + offset), _LEAST, 1 - _LEAST)
            likelihood = xlogy(right, share) + xlogy(1 - right, 1 - share)
            return float(-likelihood.sum() + _PRIOR * (slope**2 + offset**2))

        slope, offset = minimize(loss, np.zeros(2), method="Nelder-Mead").x
        fitted.append((round(float(np.exp(slope)), 4), round(float(offset), 4)))
    return tuple(fitted)


def calibration_error(
    labels: Sequence[tuple[np.ndarray, np.ndarray]], found: Sequence[np.ndarray], least: float = 0.05, bins: int = 10
) -> float:
    """Expected calibration error of all classes together: mean of |share that is right - mean confidence|.

    Of boxes with a confidence of `least` or more, in bins of equal width, weighted by their boxes (Naeini et al., AAAI
    2015). NaN without such a box.
    """
    parts = metrics.rank_classes(labels, found, _SAME)
    confidence = np.concatenate([ranked.confidence for ranked in parts])
    right = np.concatenate([ranked.right[0, 0] for ranked in parts])
    kept = confidence >= least
    if not kept.any():
        return float("nan")
    confidence, right = confidence[kept], right[kept]
    number = np.minimum((confidence * bins).astype(int), bins - 1)
    gaps = np.bincount(number, right - confidence, bins)  # sums over a bin
    return float(np.abs(gaps).sum() / len(confidence))


def _logits(confidence: np.ndarray) -> np.ndarray:
    return np.asarray(logit(np.clip(confidence, _LEAST, 1 - _LEAST)))
