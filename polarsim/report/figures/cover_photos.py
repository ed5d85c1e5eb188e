"""Identification of the photo shown in a published cover photo, by the red boxes in the cover photo."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pandas as pd
from scipy.ndimage import maximum_filter

from polarsim.photo import ROCK, PhotoKey

MIN_SHARE = 0.35  # minimum share of the label boxes' outlines on red lines for a match
_MARGIN = 0.1  # a later photo replaces an earlier match only if the share is larger by this margin
_REACH = 9  # size of the maximum filter that widens the red lines, px


def cover_key(
    cover: np.ndarray, labels: pd.DataFrame, keys: Iterable[PhotoKey], size: tuple[int, int]
) -> PhotoKey | None:
    """Return the key whose rock boxes match the red boxes in a cover photo (h, w, 3) uint8, or None.

    Cover photos are of either camera and any azimuth, and some have numbers without boxes. Of photos with similar
    matches the first is returned. `size`: width and height of the photos, px.
    """
    red = near_red(cover)
    best, best_share = None, MIN_SHARE
    rocks = labels[labels["kind"] == ROCK]
    for key in keys:
        corners = rocks.loc[rocks["key"] == str(key), ["x0", "y0", "x1", "y1"]].to_numpy(float)
        share = share_on_red(red, corners, size)
        if share > best_share + (_MARGIN if best else 0):
            best, best_share = key, share
    return best


def near_red(cover: np.ndarray) -> np.ndarray:
    """Return a mask (h, w) of the widened red lines and digits in a cover photo (h, w, 3) uint8."""
    red = (cover[..., 0] > 150) & (cover[..., 1] < 90) & (cover[..., 2] < 90)
    return np.asarray(maximum_filter(red, _REACH))


def share_on_red(red: np.ndarray, boxes: np.ndarray, size: tuple[int, int]) -> float:
    """Return the share of the outlines of boxes (n, 4) on the mask of `near_red` (h, w); without boxes 0.

    Boxes are in pixels of a photo of a size (width, height).
    """
    scale = np.array([red.shape[1] / size[0], red.shape[0] / size[1]] * 2)
    return float(np.mean([_share_of(red, box) for box in boxes * scale])) if len(boxes) else 0.0


def _share_of(red: np.ndarray, box: np.ndarray) -> float:
    x0, y0, x1, y1 = box
    along = np.linspace(0, 1, 50)
    x, y = x0 + (x1 - x0) * along, y0 + (y1 - y0) * along
    columns = np.concatenate([x, x, np.full(50, x0), np.full(50, x1)]).clip(0, red.shape[1] - 1).astype(int)
    rows = np.concatenate([np.full(50, y0), np.full(50, y1), y, y]).clip(0, red.shape[0] - 1).astype(int)
    return float(red[rows, columns].mean())
