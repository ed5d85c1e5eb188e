"""Parts of pictures: where each rock lies, and small components that people do not see as belonging to a mask."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import find_objects

from polarsim.photo import NO_ROCK

Window = tuple[slice, slice]  # rows and columns of a picture
SMALL_PART = 0.15  # of a mask's largest connected part: nobody would outline or box smaller ones


def windows_of(ids: np.ndarray) -> dict[int, Window]:
    """Where each rock lies in a picture of rock ids."""
    windows = find_objects(ids - NO_ROCK)  # counts from 1 on; None for ids that no pixel has
    return {rock: (window[0], window[1]) for rock, window in enumerate(windows, 1 + NO_ROCK) if window}


def without_small_components(mask: np.ndarray, connectivity: int = 4) -> np.ndarray:
    """A mask (h, w) less the parts that are much smaller than its largest one; parts hang together by edges.

    With a connectivity of 8 corners hold too.
    """
    import cv2

    _, parts, figures, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=connectivity)
    areas = figures[:, cv2.CC_STAT_AREA] * (np.arange(len(figures)) > 0)  # number 0 is what lies around
    kept = areas >= SMALL_PART * max(1, areas.max())
    return np.asarray(kept[parts])
