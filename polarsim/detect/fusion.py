"""Fusion of the boxes of several detectors in one image."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from polarsim.detect.nms import suppress_by_class
from polarsim.geometry import boxes
from polarsim.photo import BOX_CLASSES


def fuse(found: Sequence[np.ndarray], nms_iou: float) -> np.ndarray:
    """Merge the boxes (n, 6) of several detectors by weighted boxes fusion (Solovyev et al., IVC 107, 2021).

    In descending order of confidence, each ungrouped box forms a group with all ungrouped boxes of its class that
    overlap it by more than `nms_iou`. The merged box is the mean of the group, weighted by confidence. The merged
    confidence is the sum over detectors of the maximum confidence in the group, divided by the number of detectors: a
    box of one of two detectors keeps half of its confidence. Unlike in the paper, groups form around their most
    confident box, not around a running mean, and merged boxes that overlap by more than `nms_iou` are suppressed.

    The result does not depend on the order of the detectors. Merging a suppressed list with itself returns the list.
    """
    rows = np.concatenate(found)
    detector = np.repeat(np.arange(len(found)), [len(detections) for detections in found])
    # By descending confidence, then by corners, so that the result does not depend on the order of the detectors.
    order = np.lexsort((*rows[:, 3::-1].T, -rows[:, 4]))
    rows, detector = rows[order], detector[order]
    fused = []
    for kind in range(len(BOX_CLASSES)):
        detections = rows[:, 5] == kind
        fused.append(_merged(rows[detections], detector[detections], len(found), nms_iou))
    return suppress_by_class(np.concatenate(fused), nms_iou)


def _merged(rows: np.ndarray, detector: np.ndarray, detectors: int, nms_iou: float) -> np.ndarray:
    """Return a merged box (m, 6) per group of sorted boxes (n, 6) of a class and their detectors (n,)."""
    group_of, surest = _groups(rows[:, :4], nms_iou)
    best = np.zeros((len(surest), detectors))
    np.maximum.at(best, (group_of, detector), rows[:, 4])
    weight = np.bincount(group_of, rows[:, 4], len(surest))
    # Offsets from the most confident box keep coinciding boxes bit-equal.
    moved = np.zeros((len(surest), 4))
    np.add.at(moved, group_of, rows[:, 4:5] * (rows[:, :4] - rows[surest[group_of], :4]))
    fused = rows[surest]
    fused[:, :4] += moved / weight[:, None]
    fused[:, 4] = np.sort(best, axis=1).sum(axis=1) / detectors  # sorted because rounding depends on the order
    return fused


def _groups(corners: np.ndarray, nms_iou: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the group (n,) of each sorted box (n, 4) and the most confident box (m,) of each group."""
    overlapping = boxes.iou(corners, corners) > nms_iou
    group_of = np.full(len(corners), -1)
    surest: list[int] = []
    for box in range(len(corners)):
        if group_of[box] < 0:
            group_of[overlapping[box] & (group_of < 0)] = len(surest)
            group_of[box] = len(surest)  # a box without area has IoU 0 even with itself
            surest.append(box)
    return group_of, np.array(surest, int)
