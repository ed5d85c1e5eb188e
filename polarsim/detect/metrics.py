"""Detection metrics: average precision as defined by COCO.

Arguments have one entry per image; boxes are (n, 4) as x0, y0, x1, y1. The rules follow COCO (Lin et al., ECCV 2014;
pycocotools `COCOeval`) including interpolation: the mean over recalls 0, 0.01 ... 1 of the maximum precision at that
recall or above. The COCO limit of 100 boxes per image is not applied.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from polarsim.geometry import boxes
from polarsim.photo import BOX_CLASSES

IOU_THRESHOLDS = np.linspace(0.5, 0.95, 10)  # mAP@[0.5:0.95]; the first threshold gives mAP@0.5
RECALLS = np.linspace(0, 1, 101)
ANY_AREA = ((0.0, np.inf),)


@dataclass(frozen=True)
class Ranked:
    """Predictions of a class in descending order of confidence, matched with labels.

    Shapes: n predictions, p images, t IoU thresholds, g ranges of area.
    """

    confidence: np.ndarray  # (n,) descending
    picture: np.ndarray  # (n,) index of the image
    right: np.ndarray  # (g, t, n) bool: true positive in the range of area
    counted: np.ndarray  # (g, t, n) bool: true or false positive; predictions of different ranges are ignored
    labels: np.ndarray  # (g, p) number of labels in the range for each image

    def of_pictures(self, chosen: np.ndarray) -> Ranked:
        """Return the predictions and labels of the images in a mask (p,). Image indices are unchanged."""
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
    thresholds: np.ndarray = IOU_THRESHOLDS,
    areas: Sequence[tuple[float, float]] = ANY_AREA,
) -> Ranked:
    """Match predictions (n, 5 or more: box, confidence) with labels (m, 4) in each image.

    In descending order of confidence, each prediction is matched with the unmatched label of maximum IoU. For a range
    of area (px^2, limits included), predictions matched with labels outside the range are ignored, as are unmatched
    predictions outside the range.
    """
    from polarsim.geometry import matching_numba

    low, high = np.array(areas, float).T[:, :, None]
    confidence_parts, picture, counts = [np.zeros(0)], [np.zeros(0, int)], []
    right, counted = ([np.zeros((len(areas), len(thresholds), 0), bool)] for _ in range(2))
    for number, (label, rows) in enumerate(zip(labels, predictions, strict=True)):
        prediction = rows[np.argsort(-rows[:, 4], kind="stable")]
        other_label, other_prediction = (
            (size < low) | (size > high) for size in (boxes.area(part[:, :4])[None] for part in (label, prediction))
        )
        matched, passed = matching_numba.match_predictions_of_photo(
            boxes.iou(prediction[:, :4], label), thresholds, other_label
        )
        confidence_parts.append(prediction[:, 4])
        picture.append(np.full(len(prediction), number))
        right.append(matched)
        counted.append(~passed & (matched | ~other_prediction[:, None]))
        counts.append((~other_label).sum(axis=1))
    order = np.argsort(-np.concatenate(confidence_parts), kind="stable")
    return Ranked(
        np.concatenate(confidence_parts)[order],
        np.concatenate(picture)[order],
        np.concatenate(right, axis=2)[:, :, order],
        np.concatenate(counted, axis=2)[:, :, order],
        np.array(counts, int).reshape(-1, len(areas)).T,
    )


def rank_classes(
    labels: Sequence[tuple[np.ndarray, np.ndarray]],
    detections: Sequence[np.ndarray],
    thresholds: np.ndarray = IOU_THRESHOLDS,
    areas: Sequence[tuple[float, float]] = ANY_AREA,
) -> list[Ranked]:
    """Apply `rank` to each class in the order of `BOX_CLASSES`.

    Parameters
    ----------
    labels : sequence of (classes (n,), boxes (n, 4))
    detections : sequence of (m, 6)
        x0, y0, x1, y1, confidence, class.
    """
    return [
        rank(
            [corners[classes == kind] for classes, corners in labels],
            [rows[rows[:, 5] == kind] for rows in detections],
            thresholds,
            areas,
        )
        for kind in range(len(BOX_CLASSES))
    ]


def mean_precision(labels: Sequence[tuple[np.ndarray, np.ndarray]], detections: Sequence[np.ndarray]) -> np.ndarray:
    """Return the average precision (10,) at each IoU threshold, mean over classes with labels; 0 without labels."""
    by_class = [precision_at_recalls(ranked).mean(axis=1) for ranked in rank_classes(labels, detections)]
    labelled = [row for row in by_class if not np.isnan(row).any()]
    return np.mean(labelled, axis=0) if labelled else np.zeros(len(IOU_THRESHOLDS))


def precision_at_recalls(ranked: Ranked, area: int = 0, weights: np.ndarray | None = None) -> np.ndarray:
    """Return the maximum precision (t, 101) at each of `RECALLS` or above, 0 beyond the last recall.

    NaN without labels. `area` is the index of the range of area, `weights` (p,) are weights of the images.
    """
    weights = np.ones(ranked.labels.shape[1]) if weights is None else weights
    count = float(ranked.labels[area] @ weights)
    if not count:
        return np.full((ranked.right.shape[1], len(RECALLS)), np.nan)
    weight = weights[ranked.picture]
    curves = np.zeros((ranked.right.shape[1], len(RECALLS)))
    for curve, right, counted in zip(curves, ranked.right[area], ranked.counted[area], strict=True):
        hits = np.flatnonzero(right)  # precision has its local maxima at true positives
        so_far = weight[hits].cumsum()
        best = so_far / np.maximum((weight * counted).cumsum()[hits], 1e-12)  # 0 before the first counted prediction
        best = np.maximum.accumulate(best[::-1])[::-1]
        indices = np.searchsorted(so_far / count, RECALLS, side="left")
        curve[indices < len(hits)] = best[indices[indices < len(hits)]]
    return curves
