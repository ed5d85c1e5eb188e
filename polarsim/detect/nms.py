"""Non-maximum suppression on a CPU, in the place of torchvision's."""

from __future__ import annotations

from typing import Any

import numpy as np


def nms(boxes: Any, scores: Any, iou_threshold: float) -> Any:
    """Indices of the boxes that no surer box overlaps by more than a threshold, the surest first.

    OpenCV's greedy loop is compiled; the one in plain torch that Ultralytics has takes fifty times as long, and most
    of the time of a prediction.

    Parameters
    ----------
    boxes : (n, 4) Tensor
        x0, y0, x1, y1.
    scores : (n,) Tensor
        Above 0.

    Returns
    -------
    (k,) int64 Tensor on the boxes' device
    """
    import cv2
    import torch

    corners = boxes.detach().cpu().numpy().astype(np.float64)
    sides: Any = np.concatenate([corners[:, :2], corners[:, 2:] - corners[:, :2]], axis=1)
    kept = cv2.dnn.NMSBoxes(sides, scores.detach().cpu().numpy().astype(np.float32), 0.0, iou_threshold)
    return torch.from_numpy(np.asarray(kept, np.int64).reshape(-1)).to(boxes.device)
