"""Average precision of bootstrap samples, compiled: one pass over the predictions a sample.

The same as `metrics.precision_at_recalls` with each sample's weights, which a test compares: matches stay, so drawing
only weighs them. All sums are of whole numbers (how often a unit is drawn), so their order changes nothing.
"""

from __future__ import annotations

import numpy as np

from polarsim.detect.metrics import RECALLS, Ranked
from polarsim.kernels import njit


def resampled_precision(ranked: Ranked, area: int, unit: np.ndarray, drawn: np.ndarray) -> np.ndarray:
    """(resamples, t) average precision at each threshold with the units of the pictures (p,) drawn anew."""
    labels = drawn @ np.bincount(unit, ranked.labels[area], drawn.shape[1])
    right, counted = ranked.right[area], ranked.counted[area]
    at_all = np.flatnonzero(counted.any(axis=0))  # the rest belongs to other ranges of area
    right, counted = right[:, at_all], counted[:, at_all]
    owner = unit[ranked.picture[at_all]].astype(np.int32)
    indices, first_index = _ragged(right)
    passed, first_passed = _ragged(~counted)
    precision = np.full((len(drawn), len(right)), np.nan)
    _precision(
        np.ascontiguousarray(drawn, float),
        labels,
        owner,
        indices,
        first_index,
        passed,
        first_passed,
        RECALLS,
        precision,
    )
    return precision


def _ragged(chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Columns of the chosen (t, n) of every row, one row behind the other, and where each row starts (t + 1,)."""
    starts = np.concatenate([[0], chosen.sum(axis=1).cumsum()])
    return np.nonzero(chosen)[1].astype(np.int32), starts.astype(np.int64)


@njit()
def _precision(
    drawn: np.ndarray,
    labels: np.ndarray,
    owner: np.ndarray,
    indices: np.ndarray,
    first_index: np.ndarray,
    passed: np.ndarray,
    first_passed: np.ndarray,
    recalls: np.ndarray,
    precision: np.ndarray,
) -> None:
    """Fill precision (r, t); rows of draws without a label stay as they are.

    Parameters
    ----------
    drawn : (r, units) float
    labels : (r,) float
        Labels of each draw.
    owner : (n,) int
        Unit of each prediction, from sure to unsure.
    indices, first_index : (sum,), (t + 1,) int
        Predictions that are right at each threshold, and where those of a threshold start.
    passed, first_passed
        The same for those that are neither right nor wrong.
    """
    predicted = np.empty(len(owner))
    longest = 0
    for level in range(len(first_index) - 1):
        longest = max(longest, first_index[level + 1] - first_index[level])
    best = np.empty(longest)
    reached = np.empty(len(recalls), np.int64)
    for row in range(len(drawn)):
        if labels[row] == 0:
            continue
        weight = drawn[row]
        total = 0.0
        for n in range(len(owner)):
            total += weight[owner[n]]
            predicted[n] = total
        for level in range(len(first_index) - 1):
            start, count = first_index[level], first_index[level + 1] - first_index[level]
            skip, last_skip = first_passed[level], first_passed[level + 1]
            found, skipped, next_recall = 0.0, 0.0, 0
            for k in range(count):
                index = indices[start + k]
                found += weight[owner[index]]
                while skip < last_skip and passed[skip] < index:
                    skipped += weight[owner[passed[skip]]]
                    skip += 1
                so_far = predicted[index] - skipped
                best[k] = found / max(so_far, 1.0)  # nothing was predicted yet where all weights are 0
                while next_recall < len(recalls) and found / labels[row] >= recalls[next_recall]:
                    reached[next_recall] = k
                    next_recall += 1
            total_precision, highest, k = 0.0, 0.0, count - 1
            for number in range(next_recall - 1, -1, -1):
                while k >= reached[number]:
                    highest = max(highest, best[k])
                    k -= 1
                total_precision += highest
            precision[row, level] = total_precision / len(recalls)
