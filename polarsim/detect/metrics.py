"""Detection figures of one class: average precision as COCO defines it, and the best overlap of every label.

All functions take one entry a picture; boxes are (n, 4) as x0, y0, x1, y1.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from polarsim.geometry import boxes

IOU_THRESHOLDS = np.linspace(0.5, 0.95, 10)  # mAP@[0.5:0.95]; the first one is mAP@0.5
RECALLS = np.linspace(0, 1, 101)


def average_precision(
    labels: Sequence[np.ndarray],
    predictions: Sequence[np.ndarray],
    confidences: Sequence[np.ndarray],
    thresholds: np.ndarray = IOU_THRESHOLDS,
) -> np.ndarray:
    """(t,) average precision at each IoU threshold: mean of the highest precision at 101 recalls or beyond.

    The rules are those of COCO's evaluation (Lin et al., ECCV 2014; pycocotools `COCOeval`): the surest prediction
    first takes the label with the largest IoU that is still free; any other prediction is a false one.
    NaN without labels.
    """
    count = sum(map(len, labels))
    if not count:
        return np.full(len(thresholds), np.nan)
    taken, sure = [np.zeros((len(thresholds), 0), bool)], [np.zeros(0)]
    for label, prediction, confidence in zip(labels, predictions, confidences, strict=True):
        order = np.argsort(-confidence, kind="stable")
        sure.append(confidence[order])
        taken.append(true_positives(boxes.iou(prediction[order], label), thresholds))
    order = np.argsort(-np.concatenate(sure), kind="stable")
    right = np.concatenate(taken, axis=1)[:, order].cumsum(axis=1)  # (t, n) among the n surest predictions
    recall = right / count
    precision = right / np.arange(1, right.shape[1] + 1)
    precision = np.maximum.accumulate(precision[:, ::-1], axis=1)[:, ::-1]
    places = [np.searchsorted(row, RECALLS, side="left") for row in recall]
    reached = [row[place[place < len(row)]] for row, place in zip(precision, places, strict=True)]
    return np.array([row.sum() / len(RECALLS) for row in reached])


def true_positives(overlap: np.ndarray, thresholds: np.ndarray) -> np.ndarray:
    """(t, n) which predictions find a label, of overlaps (n predictions from sure to unsure, m labels)."""
    found = np.zeros((len(thresholds), len(overlap)), bool)
    if not overlap.size:
        return found
    free = np.ones((len(thresholds), overlap.shape[1]), bool)
    backwards = overlap[:, ::-1]  # of equal overlaps COCO takes the last label
    for n in np.flatnonzero(overlap.max(axis=1) >= thresholds.min()):
        open_overlap = np.where(free, backwards[n], -1)
        best = open_overlap.argmax(axis=1)
        found[:, n] = open_overlap[np.arange(len(thresholds)), best] >= thresholds
        free[found[:, n], best[found[:, n]]] = False
    return found


def best_overlap(labels: np.ndarray, predictions: np.ndarray) -> np.ndarray:
    """(n,) largest IoU of each label with any prediction, 0 without one; its mean is the paper's IOU_mean."""
    if not len(predictions):
        return np.zeros(len(labels))
    return boxes.iou(labels, predictions).max(axis=1)
