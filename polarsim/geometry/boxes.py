"""Boxes (n, 4) as x0, y0, x1, y1 in pixels: overlap and one-to-one matching."""

from __future__ import annotations

import numpy as np

from polarsim.photo import HEIGHT, WIDTH


def area(boxes: np.ndarray) -> np.ndarray:
    """(n,) areas, px^2; 0 for empty boxes."""
    return np.clip(boxes[..., 2] - boxes[..., 0], 0, None) * np.clip(boxes[..., 3] - boxes[..., 1], 0, None)


def centres(boxes: np.ndarray) -> np.ndarray:
    """(n, 2) middles of boxes (n, 4)."""
    return np.asarray((boxes[:, :2] + boxes[:, 2:]) / 2)


def window(box: np.ndarray, margin: np.ndarray, width: int, height: int) -> tuple[slice, slice]:
    """Rows and columns of a picture's pixels around a box (4,), with a margin (2,) in x and y; empty outside it."""
    left, top = np.maximum(np.floor(box[:2] - margin), 0).astype(int)
    right, bottom = np.minimum(np.ceil(box[2:] + margin), [width, height]).astype(int)
    return slice(top, max(top, bottom)), slice(left, max(left, right))


def iou(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(n, m) intersection over union of every box of `first` (n, 4) with every one of `second` (m, 4)."""
    first, second = np.asarray(first, float).reshape(-1, 4), np.asarray(second, float).reshape(-1, 4)
    inter = _intersection(first, second)
    union = area(first)[:, None] + area(second)[None] - inter
    return np.divide(inter, union, out=np.zeros_like(inter), where=union > 0)


def largest_iou(boxes: np.ndarray, others: np.ndarray) -> np.ndarray:
    """(n,) IoU of each box (n, 4) with that of the others (m, 4) which it overlaps most; 0 where there is none."""
    return np.asarray(iou(boxes, others).max(axis=1, initial=0.0))


def largest_covered_share(boxes: np.ndarray, others: np.ndarray) -> np.ndarray:
    """(n,) largest intersection of each box (n, 4) with one of the others (m, 4), over the smaller area of both."""
    inter, smaller = _intersection(boxes, others), np.minimum(area(boxes)[:, None], area(others)[None])
    share = np.divide(inter, smaller, out=np.zeros_like(inter), where=smaller > 0)
    return np.asarray(share.max(axis=1, initial=0.0))


def _intersection(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(n, m) areas that boxes (n, 4) and (m, 4) share, px^2."""
    low = np.maximum(first[:, None, :2], second[None, :, :2])
    high = np.minimum(first[:, None, 2:], second[None, :, 2:])
    return np.asarray(np.prod(np.clip(high - low, 0, None), axis=-1))


def match(overlap: np.ndarray, threshold: float = 0.5) -> tuple[np.ndarray, np.ndarray]:
    """One-to-one pairs (rows, columns) with overlap >= threshold: as many as can be, then of the largest sum."""
    from scipy.optimize import linear_sum_assignment

    if not overlap.size:
        return np.zeros(0, int), np.zeros(0, int)
    gain = np.where(overlap >= threshold, 1 + overlap / (1 + min(overlap.shape)), 0.0)
    rows, columns = linear_sum_assignment(-gain)
    good = overlap[rows, columns] >= threshold
    return rows[good], columns[good]


def match_sum(overlap: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """One-to-one pairs (rows, columns) of the largest summed overlap, pairs without overlap left out."""
    from scipy.optimize import linear_sum_assignment

    if not overlap.size:
        return np.zeros(0, int), np.zeros(0, int)
    rows, columns = linear_sum_assignment(-overlap)
    good = overlap[rows, columns] > 0
    return rows[good], columns[good]


def clip(boxes: np.ndarray, width: int = WIDTH, height: int = HEIGHT) -> np.ndarray:
    """Boxes cut at the photo's border; those outside become empty."""
    return np.clip(boxes, 0, [width, height, width, height])


def around(points: np.ndarray) -> np.ndarray:
    """(4,) box around points (n, 2)."""
    return np.concatenate([points.min(axis=0), points.max(axis=0)])


def of_mask(mask: np.ndarray) -> np.ndarray | None:
    """(4,) box around the true pixels of a mask (h, w), in the corner convention; None for an empty mask."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return None
    return np.array([columns[0], rows[0], columns[-1] + 1, rows[-1] + 1], float)
