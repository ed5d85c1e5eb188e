"""Detections in an external image, the images of `polarsim detect`."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from polarsim.annotate.overlay import OverlayStyle, add_legend, draw_labels
from polarsim.photo import BOX_CLASSES, NO_ROCK

EDGES = ["x0", "y0", "x1", "y1"]
_MIN_TITLE_PX = 600  # minimum image width for a title next to the legend


def draw_detections(
    grey: np.ndarray, boxes: np.ndarray, masks: Mapping[str, np.ndarray] | None, title: str
) -> np.ndarray:
    """Return an image (h + legend, w, 3) with boxes, confidences and a legend with the number of boxes.

    Parameters
    ----------
    grey : (h, w) uint8
    boxes : (n, 6)
        Corners in pixels of the image, confidence and class number.
    masks : kind -> (h, w) bool
        Filled masks.
    title
        Text of the legend, such as the name of the image; omitted for narrow images.
    """
    width = grey.shape[1]
    labels = pd.DataFrame(boxes[:, :4], columns=EDGES)
    labels["kind"] = [BOX_CLASSES[int(number)] for number in boxes[:, 5]]
    labels["rock"], labels["confidence"] = NO_ROCK, boxes[:, 4]
    drawn = draw_labels(grey, labels, width, OverlayStyle(stated_below=np.inf), masks)
    return add_legend(drawn, f"{title}: detections with confidence" if width >= _MIN_TITLE_PX else "", labels)
