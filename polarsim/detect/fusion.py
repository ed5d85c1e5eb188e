"""What several detectors find in one picture, as one list of boxes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from polarsim.detect.nms import suppress_by_class
from polarsim.geometry import boxes
from polarsim.photo import BOX_CLASSES


def fuse(found: Sequence[np.ndarray], nms_iou: float, most: int) -> np.ndarray:
    """Merge the boxes of detectors that look at one picture: weighted boxes fusion (Solovyev et al., IVC 107, 2021).

    The surest box gathers all boxes of its class that overlap it by more than `nms_iou`, then the surest of those that
    are left, and so on. Each group becomes one box: the mean of its boxes, weighted by their confidences. Its
    confidence is the sum of every detector's surest box in the group over the number of detectors, so that a box that
    only one of two detectors finds keeps its place and half of its confidence. Unlike the paper, a group is gathered
    about its surest box and not about its running mean, and merged boxes that have come to overlap by more than
    `nms_iou` are suppressed.

    The order of the detectors does not matter. A list that is suppressed at `nms_iou`, merged with itself, stays.

    Parameters
    ----------
    found : sequence of (n, 6)
        Of every detector: x0, y0, x1, y1, confidence (above 0), class. One that finds nothing has no rows, and counts.
    nms_iou : float
        IoU above which two boxes are of one thing.
    most : int
        Boxes that are kept, the most confident ones.

    Returns
    -------
    (m, 6), the most confident first
    """
    rows = np.concatenate(found)
    detector = np.repeat(np.arange(len(found)), [len(own) for own in found])
    # The surest first; ties by corners, so that the order of the detectors decides nothing.
    order = np.lexsort((*rows[:, 3::-1].T, -rows[:, 4]))
    rows, detector = rows[order], detector[order]
    fused = []
    for kind in range(len(BOX_CLASSES)):
        own = rows[:, 5] == kind
        fused.append(_merged(rows[own], detector[own], len(found), nms_iou))
    return suppress_by_class(np.concatenate(fused), nms_iou, most)


def _merged(rows: np.ndarray, detector: np.ndarray, detectors: int, nms_iou: float) -> np.ndarray:
    """One box a group (m, 6) of boxes (n, 6) of one class, the surest first, and the detector (n,) of each."""
    group_of, surest = _groups(rows[:, :4], nms_iou)
    best = np.zeros((len(surest), detectors))
    np.maximum.at(best, (group_of, detector), rows[:, 4])
    weight = np.bincount(group_of, rows[:, 4], len(surest))
    # As offsets from the surest box: boxes that coincide stay to the last bit.
    moved = np.zeros((len(surest), 4))
    np.add.at(moved, group_of, rows[:, 4:5] * (rows[:, :4] - rows[surest[group_of], :4]))
    fused = rows[surest]
    fused[:, :4] += moved / weight[:, None]
    fused[:, 4] = np.sort(best, axis=1).sum(axis=1) / detectors  # sorted: sums depend on their order
    return fused


def _groups(corners: np.ndarray, nms_iou: float) -> tuple[np.ndarray, np.ndarray]:
    """Group (n,) of each box (n, 4), the surest first, and the surest box (m,) of each group."""
    near = boxes.iou(corners, corners) > nms_iou
    group_of = np.full(len(corners), -1)
    surest: list[int] = []
    for box in range(len(corners)):
        if group_of[box] < 0:
            group_of[near[box] & (group_of < 0)] = len(surest)
            group_of[box] = len(surest)  # a box without area overlaps nothing, itself included
            surest.append(box)
    return group_of, np.array(surest, int)
