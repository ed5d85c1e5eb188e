"""Non-maximum suppression by OpenCV: torchvision's wheel is built against CUDA and fails beside a CPU torch."""

from __future__ import annotations

from typing import Any

import numpy as np

from polarsim.photo import BOX_CLASSES


def suppress(boxes: np.ndarray, scores: np.ndarray, iou_threshold: float) -> np.ndarray:
    """Indices of the boxes that no more confident box overlaps by more than a threshold, the most confident first.

    OpenCV's greedy loop is compiled; the one in plain torch that Ultralytics has takes fifty times as long, and most
    of the time of a prediction.

    Parameters
    ----------
    boxes : (n, 4)
        x0, y0, x1, y1.
    scores : (n,)
        Above 0.

    Returns
    -------
    (k,) int64
    """
    import cv2

    corners = boxes.astype(np.float64)
    sides: Any = np.concatenate([corners[:, :2], corners[:, 2:] - corners[:, :2]], axis=1)
    return np.asarray(cv2.dnn.NMSBoxes(sides, scores.astype(float).tolist(), 0.0, iou_threshold), np.int64).reshape(-1)


def suppress_by_class(rows: np.ndarray, iou_threshold: float, most: int) -> np.ndarray:
    """Boxes (n, 6) without those that a more confident one of their class overlaps by more than a threshold.

    Parameters
    ----------
    rows : (n, 6)
        x0, y0, x1, y1, confidence, class.
    most
        Boxes that are kept, the most confident ones.

    Returns
    -------
    (k, 6), the most confident first
    """
    kept = [rows[:0]]
    for kind in range(len(BOX_CLASSES)):
        own = rows[rows[:, 5] == kind]
        kept.append(own[suppress(own[:, :4], own[:, 4], iou_threshold)] if len(own) else own)
    table = np.concatenate(kept)
    return table[np.argsort(-table[:, 4], kind="stable")[:most]]


def nms(boxes: Any, scores: Any, iou_threshold: float) -> Any:
    """`suppress` of tensors, its indices on the boxes' device."""
    import torch

    kept = suppress(boxes.detach().cpu().numpy(), scores.detach().cpu().numpy(), iou_threshold)
    return torch.from_numpy(kept).to(boxes.device)
