"""Detection figures of one class: average precision as COCO defines it, and the best overlap of every label.

All functions take one entry a picture; boxes are (n, 4) as x0, y0, x1, y1. The rules are those of COCO's evaluation
(Lin et al., ECCV 2014; pycocotools `COCOeval`), interpolation included: the mean, over the recalls 0, 0.01 ... 1, of
the highest precision at that recall or beyond. Only its limit of 100 boxes a picture is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from polarsim.geometry import boxes
from polarsim.photo import BOX_CLASSES

IOU_THRESHOLDS = np.linspace(0.5, 0.95, 10)  # mAP@[0.5:0.95]; the first one is mAP@0.5
RECALLS = np.linspace(0, 1, 101)
ANY_AREA = ((0.0, np.inf),)


@dataclass(frozen=True)
class Ranked:
    """All predictions of a class, matched with labels once, from sure to unsure: sums over them give any figure.

    There are n predictions, p pictures, t thresholds of IoU, and g ranges of area.
    """

    confidence: np.ndarray  # (n,) falling
    picture: np.ndarray  # (n,) its number
    right: np.ndarray  # (g, t, n) bool: takes a label of the range
    counted: np.ndarray  # (g, t, n) bool: right or wrong; the others are neither, for they concern another range
    labels: np.ndarray  # (g, p) labels of the range in each picture

    def of_pictures(self, chosen: np.ndarray) -> Ranked:
        """The same for the chosen (p,) bool pictures alone; they keep their numbers."""
        kept = chosen[self.picture]
        return Ranked(
            self.confidence[kept],
            self.picture[kept],
            self.right[:, :, kept],
            self.counted[:, :, kept],
            np.where(chosen, self.labels, 0),
        )


def rank(
    labels: Sequence[np.ndarray],
    predictions: Sequence[np.ndarray],
    confidences: Sequence[np.ndarray],
    thresholds: np.ndarray = IOU_THRESHOLDS,
    areas: Sequence[tuple[float, float]] = ANY_AREA,
) -> Ranked:
    """Match predictions with labels, picture by picture.

    The surest prediction first takes the label with the largest IoU that is still free. Where only some areas (px^2,
    both ends included) are asked for, labels of others are free for all: a prediction on them is neither right nor
    wrong, nor is one of another area that takes no label.
    """
    from polarsim.geometry import matching_numba

    low, high = np.array(areas, float).T[:, :, None]
    sure, picture, counts = [np.zeros(0)], [np.zeros(0, int)], []
    right, counted = ([np.zeros((len(areas), len(thresholds), 0), bool)] for _ in range(2))
    for number, (label, prediction, confidence) in enumerate(zip(labels, predictions, confidences, strict=True)):
        order = np.argsort(-confidence, kind="stable")
        prediction = prediction[order].reshape(-1, 4)
        label = label.reshape(-1, 4)
        other_label, other = (
            (size < low) | (size > high) for size in (boxes.area(label)[None], boxes.area(prediction)[None])
        )
        matched, passed = matching_numba.match(boxes.iou(prediction, label), thresholds, other_label)
        sure.append(confidence[order])
        picture.append(np.full(len(order), number))
        right.append(matched)
        counted.append(~passed & (matched | ~other[:, None]))
        counts.append((~other_label).sum(axis=1))
    order = np.argsort(-np.concatenate(sure), kind="stable")
    return Ranked(
        np.concatenate(sure)[order],
        np.concatenate(picture)[order],
        np.concatenate(right, axis=2)[:, :, order],
        np.concatenate(counted, axis=2)[:, :, order],
        np.array(counts, int).reshape(-1, len(areas)).T,
    )


def mean_precision(
    labels: Sequence[tuple[np.ndarray, np.ndarray]],
    found: Sequence[np.ndarray],
    thresholds: np.ndarray = IOU_THRESHOLDS,
) -> np.ndarray:
    """(t,) average precision at each IoU threshold, mean over the classes that have labels; 0 where none has.

    Parameters
    ----------
    labels : sequence of (classes (n,), boxes (n, 4))
    found : sequence of (m, 6)
        x0, y0, x1, y1, confidence, class.
    """
    by_class = [precision_at_recalls(ranked).mean(axis=1) for ranked in rank_classes(labels, found, thresholds)]
    labelled = [row for row in by_class if not np.isnan(row).any()]
    return np.mean(labelled, axis=0) if labelled else np.zeros(len(thresholds))


def rank_classes(
    labels: Sequence[tuple[np.ndarray, np.ndarray]], found: Sequence[np.ndarray], thresholds: np.ndarray
) -> list[Ranked]:
    """What `rank` says of each class, in the order of `BOX_CLASSES`; arguments as of `mean_precision`."""
    return [
        rank(
            [corners[classes == kind] for classes, corners in labels],
            [rows[rows[:, 5] == kind, :4] for rows in found],
            [rows[rows[:, 5] == kind, 4] for rows in found],
            thresholds,
        )
        for kind in range(len(BOX_CLASSES))
    ]


def precision_at_recalls(ranked: Ranked, area: int = 0, weights: np.ndarray | None = None) -> np.ndarray:
    """(t, 101) highest precision at each of `RECALLS` or beyond, 0 where no recall goes so far; NaN without labels.

    Parameters
    ----------
    area
        Number of the range of area.
    weights : (p,)
        How often each picture counts; once when None.
    """
    weights = np.ones(ranked.labels.shape[1]) if weights is None else weights
    count = float(ranked.labels[area] @ weights)
    if not count:
        return np.full((ranked.right.shape[1], len(RECALLS)), np.nan)
    weight = weights[ranked.picture]
    curves = np.zeros((ranked.right.shape[1], len(RECALLS)))
    for curve, right, counted in zip(curves, ranked.right[area], ranked.counted[area], strict=True):
        found = np.flatnonzero(right)  # the highest precisions stand where a label has just been found
        so_far = weight[found].cumsum()
        best = so_far / np.maximum((weight * counted).cumsum()[found], 1e-12)  # 0 before the first that counts
        best = np.maximum.accumulate(best[::-1])[::-1]
        indices = np.searchsorted(so_far / count, RECALLS, side="left")
        curve[indices < len(found)] = best[indices[indices < len(found)]]
    return curves


def best_overlap(labels: np.ndarray, predictions: np.ndarray) -> np.ndarray:
    """(n,) largest IoU of each label with any prediction, 0 without one; its mean is the paper's IOU_mean."""
    if not len(predictions):
        return np.zeros(len(labels))
    return boxes.iou(labels, predictions).max(axis=1)
