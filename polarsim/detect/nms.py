"""Non-maximum suppression by OpenCV. The torchvision wheel requires CUDA and fails with a CPU build of torch."""

from __future__ import annotations

from typing import Any

import numpy as np

from polarsim.photo import BOX_CLASSES

MAX_BOXES = 300  # maximum number of boxes per image, as in the validation of YOLOv5


def suppress(boxes: np.ndarray, scores: np.ndarray, iou_threshold: float) -> np.ndarray:
    """Return the indices (k,) int64 of boxes (n, 4) after greedy suppression, by descending scores (n,), all above 0.

    The compiled loop of OpenCV is 50 times faster than the torch implementation of Ultralytics, which dominates the
    inference time.
    """
    import cv2

    corners = boxes.astype(np.float64)
    sides: Any = np.concatenate([corners[:, :2], corners[:, 2:] - corners[:, :2]], axis=1)
    return np.asarray(cv2.dnn.NMSBoxes(sides, scores.astype(float).tolist(), 0.0, iou_threshold), np.int64).reshape(-1)


def suppress_by_class(rows: np.ndarray, iou_threshold: float) -> np.ndarray:
    """Return at most `MAX_BOXES` boxes (k, 6) x0, y0, x1, y1, confidence, class after suppression in each class.

    Boxes are in descending order of confidence.
    """
    kept = [rows[:0]]
    for kind in range(len(BOX_CLASSES)):
        of_class = rows[rows[:, 5] == kind]
        kept.append(of_class[suppress(of_class[:, :4], of_class[:, 4], iou_threshold)] if len(of_class) else of_class)
    table = np.concatenate(kept)
    return table[np.argsort(-table[:, 4], kind="stable")[:MAX_BOXES]]


def nms(boxes: Any, scores: Any, iou_threshold: float) -> Any:
    """Apply `suppress` to tensors; return indices on the device of the boxes."""
    import torch

    kept = suppress(boxes.detach().cpu().numpy(), scores.detach().cpu().numpy(), iou_threshold)
    return torch.from_numpy(kept).to(boxes.device)
