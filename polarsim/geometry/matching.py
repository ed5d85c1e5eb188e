"""Predicted boxes matched with labels from sure to unsure, as COCO's evaluation matches them: the reference.

The surest prediction first takes the label with the largest IoU that is still free.
"""

from __future__ import annotations

import numpy as np


def match(overlap: np.ndarray, thresholds: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(g, t, n) which predictions take a label that is asked for, and which take one that is not (`other`, (g, m)).

    Of overlaps (n predictions from sure to unsure, m labels). Labels that are asked for go first.
    `matching_numba` obeys.
    """
    shape = (len(other), len(thresholds))
    matched, passed = np.zeros((*shape, len(overlap)), bool), np.zeros((*shape, len(overlap)), bool)
    if not overlap.size:
        return matched, passed
    asked = ~other[:, None, ::-1]  # backwards: of equal overlaps COCO takes the last label
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
