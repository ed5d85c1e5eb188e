"""Matching of predictions with labels in the order of confidence, as in COCO's evaluation.

The most confident prediction first gets the unmatched label with the largest IoU. Tests compare with pycocotools.
"""

from __future__ import annotations

import numpy as np

from polarsim.kernels import njit


def match_predictions_of_photo(
    overlap: np.ndarray, thresholds: np.ndarray, other: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return (g, t, n) which predictions match a wanted label, and which match an ignored label (`other`, (g, m)).

    `overlap` are IoU (n predictions in descending confidence, m labels). Wanted labels are preferred.
    """
    shape = (len(other), len(thresholds), len(overlap))
    matched, passed = np.zeros(shape, np.bool_), np.zeros(shape, np.bool_)
    if overlap.size:
        # Numba reads arrays of the opposite byte order as if they had the machine's byte order.
        overlap, thresholds = np.ascontiguousarray(overlap, float), np.ascontiguousarray(thresholds, float)
        near = np.flatnonzero(overlap.max(axis=1) >= thresholds.min())
        _match(overlap, thresholds, np.ascontiguousarray(other, bool), near, matched, passed)
    return matched, passed


@njit()
def _match(
    overlap: np.ndarray,
    thresholds: np.ndarray,
    other: np.ndarray,
    near: np.ndarray,
    matched: np.ndarray,
    passed: np.ndarray,
) -> None:
    """Fill matched and passed for the predictions `near` (k,) a label."""
    free = np.empty(overlap.shape[1], np.bool_)
    for area in range(len(other)):
        for level in range(len(thresholds)):
            free[:] = True
            for n in near:
                best, second = -1, -1
                for label in range(overlap.shape[1]):
                    common = overlap[n, label]
                    if not free[label] or not common >= thresholds[level]:
                        continue
                    if other[area, label]:
                        if second < 0 or common >= overlap[n, second]:  # COCO selects the last of equal overlaps
                            second = label
                    elif best < 0 or common >= overlap[n, best]:
                        best = label
                if best >= 0:
                    matched[area, level, n] = True
                    free[best] = False
                elif second >= 0:
                    passed[area, level, n] = True
                    free[second] = False
