"""Boxes (n, 4) as x0, y0, x1, y1 in pixels: overlap and one-to-one matching."""

from __future__ import annotations

from typing import Literal

import numpy as np

from polarsim.photo import photo_scale

_MATCH_GATE_PX = 40.0  # of photos of the reference width: errors of poses cause less
MAX_LOG_SIZE = 1.6  # maximum |log width ratio| + |log height ratio| of a pair


def area(boxes: np.ndarray) -> np.ndarray:
    """Return areas (n,), px^2; 0 for empty boxes."""
    boxes = np.asarray(boxes, float)
    return np.clip(boxes[..., 2] - boxes[..., 0], 0, None) * np.clip(boxes[..., 3] - boxes[..., 1], 0, None)


def box_centres(boxes: np.ndarray) -> np.ndarray:
    """Return the centres (n, 2) of boxes (n, 4)."""
    boxes = np.asarray(boxes, float)
    return np.asarray((boxes[:, :2] + boxes[:, 2:]) / 2)


def pixel_window(box: np.ndarray, margin: np.ndarray, width: int, height: int) -> tuple[slice, slice]:
    """Return rows and columns of an image's pixels around a box (4,), with a margin (2,) in x and y; empty outside."""
    box, margin = np.asarray(box, float), np.asarray(margin, float)
    left, top = np.maximum(np.floor(box[:2] - margin), 0).astype(int)
    right, bottom = np.minimum(np.ceil(box[2:] + margin), [width, height]).astype(int)
    return slice(top, max(top, bottom)), slice(left, max(left, right))


def iou(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the IoU (n, m) of all pairs of boxes `first` (n, 4) and `second` (m, 4)."""
    first, second = _rows(first), _rows(second)
    inter = _intersection(first, second)
    union = area(first)[:, None] + area(second)[None] - inter
    return np.divide(inter, union, out=np.zeros_like(inter), where=union > 0)


def largest_iou(boxes: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return the maximum IoU (n,) of each box (n, 4) with the boxes `others` (m, 4); 0 without others."""
    return np.asarray(iou(boxes, others).max(axis=1, initial=0.0))


def largest_covered_share(boxes: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return the maximum intersection (n,) of each box (n, 4) with `others` (m, 4), over the smaller of both areas."""
    boxes, others = _rows(boxes), _rows(others)
    inter, smaller = _intersection(boxes, others), np.minimum(area(boxes)[:, None], area(others)[None])
    share = np.divide(inter, smaller, out=np.zeros_like(inter), where=smaller > 0)
    return np.asarray(share.max(axis=1, initial=0.0))


def _rows(boxes: np.ndarray) -> np.ndarray:
    """Convert boxes (n, 4) to float: unsigned and short integers would overflow in differences and areas."""
    return np.asarray(boxes, float).reshape(-1, 4)


def _intersection(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the intersection areas (n, m) of boxes (n, 4) and (m, 4), px^2."""
    width, height = (
        np.minimum(first[:, None, axis + 2], second[:, axis + 2]) - np.maximum(first[:, None, axis], second[:, axis])
        for axis in (0, 1)
    )
    return np.asarray(np.maximum(width, 0) * np.maximum(height, 0))


def match_pairs(
    score: np.ndarray, allowed: np.ndarray, objective: Literal["most", "sum", "greedy"] = "most"
) -> tuple[np.ndarray, np.ndarray]:
    """Return rows and columns (p,) of one-to-one pairs of a score (n, m), among the `allowed` (n, m) pairs.

    `score`: higher is better; NaN for pairs that are not allowed.
    `objective`: `most`: maximum number of pairs, then maximum summed score. `sum`: maximum summed score, for scores
    above 0. `greedy`: the best pair first, then the best of the remaining pairs.
    """
    if not allowed.any():
        return np.zeros(0, int), np.zeros(0, int)
    if objective == "greedy":
        return _greedy_pairs(score, allowed)
    from scipy.optimize import linear_sum_assignment

    gain = score
    if objective == "most":
        low, high = score[allowed].min(), score[allowed].max()
        gain = 1 + (score - low) / ((1 + min(score.shape)) * max(high - low, 1.0))  # a pair outweighs all scores
    rows, columns = linear_sum_assignment(np.where(allowed, -gain, 0.0))
    good = allowed[rows, columns]
    return rows[good], columns[good]


def _greedy_pairs(score: np.ndarray, allowed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    free, matched = np.where(allowed, score, -np.inf), []
    while np.isfinite(best := free.max()):
        row, column = np.argwhere(free == best)[0]
        free[row], free[:, column] = -np.inf, -np.inf
        matched.append((row, column))
    rows, columns = np.array(matched).T
    return rows, columns


def match_by_iou(overlap: np.ndarray, threshold: float = 0.5) -> tuple[np.ndarray, np.ndarray]:
    """Match one to one (rows, columns) with overlap >= threshold: maximum number of pairs, then maximum sum."""
    return match_pairs(overlap, overlap >= threshold)


def match_by_summed_iou(overlap: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Match one to one (rows, columns) with maximum summed overlap, without pairs that do not overlap."""
    return match_pairs(overlap, overlap > 0, "sum")


def match_by_distance(
    boxes: np.ndarray, others: np.ndarray, gate_px: float, smallest_iou: float = 0.2
) -> tuple[np.ndarray, np.ndarray]:
    """Match boxes (n, 4) with `others` (m, 4) (rows, columns): maximum number of pairs, then nearest and most similar.

    Pairs with a distance above the gate, centre to centre, must overlap by `smallest_iou`, because large boxes may be
    off by more.
    """
    overlap = iou(boxes, others)
    distance = np.linalg.norm(box_centres(boxes)[:, None] - box_centres(others)[None], axis=-1)
    return match_pairs(overlap - distance / gate_px, (distance <= gate_px) | (overlap >= smallest_iou))


def clip(boxes: np.ndarray, width: int, height: int) -> np.ndarray:
    """Clip boxes at the image border; boxes outside become empty."""
    return np.clip(boxes, 0, [width, height, width, height])


def box_around_points(points: np.ndarray) -> np.ndarray:
    """Return the box (4,) around points (n, 2)."""
    return np.concatenate([points.min(axis=0), points.max(axis=0)])


def rotated_box(box: np.ndarray, angle_deg: float) -> np.ndarray:
    """Return the box (4,) around a box (4,) that is rotated about its centre."""
    cos, sin = abs(np.cos(np.radians(angle_deg))), abs(np.sin(np.radians(angle_deg)))
    half_width, half_height = (box[2:] - box[:2]) / 2
    half = np.array([half_width * cos + half_height * sin, half_width * sin + half_height * cos])
    centre = (box[:2] + box[2:]) / 2
    return np.concatenate([centre - half, centre + half])


def box_of_ellipse(centre: np.ndarray, radii: np.ndarray, angle_deg: float = 0.0) -> np.ndarray:
    """Return the box (4,) around an ellipse of semi-axes (2,) that is rotated about its centre (2,)."""
    cos, sin = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    half = np.hypot(radii * cos, radii[::-1] * sin)
    return np.concatenate([centre - half, centre + half])


def box_of_mask(mask: np.ndarray) -> np.ndarray | None:
    """Return the box (4,) around the true pixels of a mask (h, w), in the corner convention; None for an empty mask."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return None
    return np.array([columns[0], rows[0], columns[-1] + 1, rows[-1] + 1], float)


def match_gate_px(width: int) -> float:
    """Return the usual maximum distance of a pair, centre to centre, px of a photo of a width, px."""
    return _MATCH_GATE_PX * photo_scale(width)


def match_by_position_and_size(
    projected: np.ndarray, annotated: np.ndarray, gate_px: float
) -> tuple[np.ndarray, np.ndarray]:
    """Match projected (m, 4) and annotated (b, 4) boxes of similar position and size (rows, columns).

    `gate_px`: maximum distance of a pair, centre to centre.
    """
    projected, annotated = _rows(projected), _rows(annotated)
    size = np.maximum(projected[:, 2:] - projected[:, :2], 1e-3)
    size_annotated = annotated[:, 2:] - annotated[:, :2]
    offset = (projected[:, None, :2] + projected[:, None, 2:] - annotated[None, :, :2] - annotated[None, :, 2:]) / 2
    distance = np.linalg.norm(offset, axis=-1)
    log_size = np.abs(np.log(size[:, None] / size_annotated[None])).sum(axis=-1)
    cost = distance / gate_px + 0.5 * log_size - 0.5 * iou(np.nan_to_num(projected), annotated)
    return match_pairs(-cost, (distance <= gate_px) & (log_size <= MAX_LOG_SIZE))  # excludes NaN
