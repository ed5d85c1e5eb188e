"""Boxes whose class was swapped: a shadow annotated where other lamps show a rock is that rock."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from polarsim.geometry.boxes import largest_iou

SAME_ROCK = 0.3  # IoU of a rock's boxes that two people drew, or one person twice
SHADOW_ON_ROCK = 0.5  # IoU of a shadow's box with a rock that makes it the rock
AZIMUTHS = 2  # that must show the rock


def rocks_called_shadows(shadows: np.ndarray, rocks: np.ndarray, elsewhere: Sequence[np.ndarray]) -> np.ndarray:
    """Which shadows of a photo are rocks.

    Parameters
    ----------
    shadows, rocks : (n, 4), (m, 4) float
        Boxes of one photo, pixels.
    elsewhere : sequence of (k, 4) float
        Rock boxes of the same view under other lamps, one array an azimuth.

    Returns
    -------
    (n,) bool
    """
    shown = np.sum([largest_iou(shadows, boxes) >= SHADOW_ON_ROCK for boxes in elsewhere], axis=0)
    return np.asarray((shown >= AZIMUTHS) & (largest_iou(shadows, rocks) < SAME_ROCK))
