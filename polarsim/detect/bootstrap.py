"""Units of the bootstrap of detectors, views or photos, and average precision of resamples; see `polarsim.intervals`.

Photos of one view show the same rocks from the same position under other light: they are not independent, and intervals
over photos come out too narrow. Views of one terrain show the same rocks too, from elsewhere; few terrains are tested,
so intervals say how sure a figure is of these terrains, not of another one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from polarsim.detect.metrics import RECALLS, Ranked
from polarsim.errors import DetectError, LabelError
from polarsim.photo import PhotoKey

Unit = Literal["view", "photo"]
_CHUNK = 100_000  # numbers that are worked on at once: they stay in the cache


def units_of(keys: Sequence[str], unit: Unit) -> np.ndarray:
    """(n,) number of each photo's view, from 0, in the order of the views; or of each photo.

    Raises
    ------
    DetectError
        Views are asked for, and a name is no photo key.
    """
    if unit == "photo":
        return np.unique(np.array(keys, str), return_inverse=True)[1]
    try:
        views = [PhotoKey.parse(key).view for key in keys]
    except LabelError as error:
        raise DetectError(f"{error}, so its view is not known: draw photos instead") from error
    number = {view: n for n, view in enumerate(sorted(set(views)))}
    return np.array([number[view] for view in views], int)


def resampled_precision(ranked: Ranked, area: int, unit: np.ndarray, drawn: np.ndarray) -> np.ndarray:
    """(resamples, t) average precision at each threshold with the units of the pictures (p,) drawn anew.

    The same as `precision_at_recalls` with each resample's weights: matches stay, so drawing only weighs them.
    `bootstrap_numba` obeys.
    """
    labels = drawn @ np.bincount(unit, ranked.labels[area], drawn.shape[1])
    at_all = np.flatnonzero(ranked.counted[area].any(axis=0))  # the rest belongs to other ranges of area
    owner = unit[ranked.picture[at_all]]
    levels = [
        _Level(owner, right, counted)
        for right, counted in zip(ranked.right[area][:, at_all], ranked.counted[area][:, at_all], strict=True)
    ]
    precision = np.full((len(drawn), len(levels)), np.nan)
    known = np.flatnonzero(labels)
    for chunk in np.array_split(known, max(1, len(known) * len(owner) // _CHUNK)):
        predicted = drawn[chunk][:, owner].cumsum(axis=1)
        for number, level in enumerate(levels):
            precision[chunk, number] = level.precision(drawn[chunk], predicted, labels[chunk])
    return precision


class _Level:
    """Right predictions at one threshold of IoU, among the n that some threshold counts.

    Parameters
    ----------
    owner : (n,) int
        Unit of each prediction.
    right, counted : (n,) bool
        As in `Ranked`.
    """

    def __init__(self, owner: np.ndarray, right: np.ndarray, counted: np.ndarray) -> None:
        self._indices, passed = np.flatnonzero(right), np.flatnonzero(~counted)
        self._owner, self._owner_passed = owner[self._indices], owner[passed]
        self._passed_before = np.searchsorted(passed, self._indices)

    def precision(self, drawn: np.ndarray, predicted: np.ndarray, labels: np.ndarray) -> np.ndarray:
        """(r,) average precision of draws (r, units), of predictions so far (r, n) and all labels (r,)."""
        if not len(self._indices):
            return np.zeros(len(drawn))
        so_far = predicted[:, self._indices]
        if len(self._owner_passed):
            passed = np.zeros((len(drawn), len(self._owner_passed) + 1))
            passed[:, 1:] = drawn[:, self._owner_passed].cumsum(axis=1)
            so_far -= passed[:, self._passed_before]
        right = drawn[:, self._owner].cumsum(axis=1)
        best = right / np.maximum(so_far, 1)  # nothing was predicted yet where all weights are 0
        np.maximum.accumulate(best[:, ::-1], axis=1, out=best[:, ::-1])
        recall = right / labels[:, None]
        reached = (recall * (len(RECALLS) - 1) + 1e-6).astype(int)
        reached -= RECALLS[reached] > recall  # as floating point compares them, which is how COCO does
        reached[:, 1:] -= reached[:, :-1].copy()
        reached[:, 0] += 1  # recall 0
        return np.einsum("rk,rk->r", best, reached) / len(RECALLS)
