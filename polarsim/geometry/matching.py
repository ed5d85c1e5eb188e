"""Matching of predictions with labels in the order of confidence, as in COCO's evaluation: the reference.

The most confident prediction first gets the unmatched label with the largest IoU.
"""

from __future__ import annotations

import numpy as np


def match_predictions_of_photo(
    overlap: np.ndarray, thresholds: np.ndarray, other: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return (g, t, n) which predictions match a wanted label, and which match an ignored label (`other`, (g, m)).

    `overlap` are IoU (n predictions in descending confidence, m labels). Wanted labels are preferred.
    `matching_numba` must return the same.
    """
    shape = (len(other), len(thresholds))
    matched, passed = np.zeros((*shape, len(overlap)), bool), np.zeros((*shape, len(overlap)), bool)
    if not overlap.size:
        return matched, passed
    asked = ~other[:, None, ::-1]  # backwards, because COCO selects the last of equal overlaps
    free = np.ones((*shape, overlap.shape[1]), bool)
    ranges, levels = np.ogrid[: shape[0], : shape[1]]
    backwards, some_other = overlap[:, ::-1], other.any()
    for n in np.flatnonzero(overlap.max(axis=1) >= thresholds.min()):
        near = free & (backwards[n] >= thresholds[:, None])
        wanted = near & asked
        best = np.where(wanted, backwards[n], -1).argmax(axis=2)
        matched[:, :, n] = wanted[ranges, levels, best]
        if some_other:
            rest = near & ~asked & ~matched[:, :, n, None]
            second = np.where(rest, backwards[n], -1).argmax(axis=2)
            passed[:, :, n] = rest[ranges, levels, second]
            best = np.where(matched[:, :, n], best, second)
        free[ranges, levels, best] &= ~(matched[:, :, n] | passed[:, :, n])
    return matched, passed
