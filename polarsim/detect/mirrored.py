"""A detector that looks at every picture as it is and mirrored left to right: it finds more, in twice the time."""

from __future__ import annotations

import numpy as np

from polarsim.detect.detectors.families import MAX_BOXES, LoadedDetector, LoadedMasks
from polarsim.detect.fusion import fuse


def boxes_both_ways(loaded: LoadedDetector, nms_iou: float) -> LoadedDetector:
    """A detector whose boxes of a picture and of the mirrored one are merged by `fuse`, as those of two detectors are.

    A thing that is found in one of the two alone keeps half of its confidence.
    """

    def detect(pictures: np.ndarray) -> list[np.ndarray]:
        width = pictures.shape[2]
        both = zip(loaded(pictures), loaded(_mirrored(pictures)), strict=True)
        return [fuse([own, _mirrored_boxes(other, width)], nms_iou, MAX_BOXES) for own, other in both]

    return detect


def masks_both_ways(loaded: LoadedMasks) -> LoadedMasks:
    """The mean of the probabilities of a picture and of the mirrored one."""
    return lambda pictures: (loaded(pictures) + _mirrored(loaded(_mirrored(pictures)))) / np.float32(2)


def _mirrored(pictures: np.ndarray) -> np.ndarray:
    """Pictures (..., w), the last column first."""
    return np.ascontiguousarray(pictures[..., ::-1])


def _mirrored_boxes(boxes: np.ndarray, width: int) -> np.ndarray:
    """Boxes (n, 6) x0, y0, x1, y1, confidence, class of a mirrored picture, in pixels of the picture itself."""
    turned = boxes.copy()
    turned[:, [0, 2]] = width - boxes[:, [2, 0]]
    return turned
