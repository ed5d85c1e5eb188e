"""Average precision of bootstrap replicates, compiled: a single pass over the predictions per replicate.

Equivalent to `metrics.precision_at_recalls` with the weights of each replicate, which is the reference in a test.
Resampling changes only the weights of matches. All sums are sums of integers (draw counts), so their order does not
affect the result.
"""

from __future__ import annotations

import numpy as np

from polarsim.detect.metrics import RECALLS, Ranked
from polarsim.kernels import njit


def resampled_precision(ranked: Ranked, area: int, unit: np.ndarray, drawn: np.ndarray) -> np.ndarray:
    """Return the average precision (resamples, t) at each threshold, for the unit (p,) of each image."""
    labels = drawn @ np.bincount(unit, ranked.labels[area], drawn.shape[1])
    right, counted = ranked.right[area], ranked.counted[area]
    at_all = np.flatnonzero(counted.any(axis=0))  # predictions in this range of area
    right, counted = right[:, at_all], counted[:, at_all]
    owner = unit[ranked.picture[at_all]].astype(np.int32)
    indices, first_index = _ragged(right)
    passed, first_passed = _ragged(~counted)
    precision = np.full((len(drawn), len(right)), np.nan)
    weights = np.ascontiguousarray(drawn, float)
    _precision(weights, labels, owner, indices, first_index, passed, first_passed, RECALLS, precision)
    return precision


def _ragged(chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the column indices of True values of a mask (t, n), row by row, and the start of each row (t + 1,)."""
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
    """Fill precision (r, t) of replicates with labels (r,) > 0.

    `owner` (n,) is the unit of each prediction, in descending order of confidence. `indices` (sum,) are the true
    positives of all thresholds, `first_index` (t + 1,) the start of each threshold; `passed` the same for ignored
    predictions, which are neither true nor false positives.
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
                best[k] = found / max(so_far, 1.0)  # so_far is 0 if all weights are 0
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
