"""Which photo a published cover photo shows, told by the red boxes that its authors drew into it."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pandas as pd
from scipy.ndimage import maximum_filter

from polarsim.photo import HEIGHT, ROCK, WIDTH, PhotoKey

SAME = 0.35  # share of our boxes' outlines on drawn red lines from which a cover photo is taken to show that photo
_ALIKE = 0.1  # difference of two such shares that says nothing
_REACH = 9  # pixels between our line and the red one


def cover_key(cover: np.ndarray, labels: pd.DataFrame, keys: Iterable[PhotoKey]) -> PhotoKey | None:
    """The photo, of some keys, whose rock boxes lie on the red boxes drawn into a cover photo (h, w, 3) uint8.

    None when no photo's boxes do: covers show either camera and any azimuth, and some have numbers only. Of photos that
    fit nearly alike the first one wins.
    """
    red = near_red(cover)
    best, best_share = None, SAME
    rocks = labels[labels["kind"] == ROCK]
    for key in keys:
        share = share_on_red(red, rocks.loc[rocks["key"] == str(key), ["x0", "y0", "x1", "y1"]].to_numpy(float))
        if share > best_share + (_ALIKE if best else 0):
            best, best_share = key, share
    return best


def near_red(cover: np.ndarray) -> np.ndarray:
    """(h, w) bool: the lines and digits that its authors drew into a cover photo (h, w, 3) uint8, widened."""
    drawn = (cover[..., 0] > 150) & (cover[..., 1] < 90) & (cover[..., 2] < 90)
    return np.asarray(maximum_filter(drawn, _REACH))


def share_on_red(red: np.ndarray, boxes: np.ndarray) -> float:
    """Share of the outlines of boxes (n, 4), pixels of a whole photo, on a cover's `near_red` (h, w); 0 of none."""
    scale = np.array([red.shape[1] / WIDTH, red.shape[0] / HEIGHT] * 2)
    return float(np.mean([_share_of(red, box) for box in boxes * scale])) if len(boxes) else 0.0


def _share_of(red: np.ndarray, box: np.ndarray) -> float:
    x0, y0, x1, y1 = box
    along = np.linspace(0, 1, 50)
    x, y = x0 + (x1 - x0) * along, y0 + (y1 - y0) * along
    columns = np.concatenate([x, x, np.full(50, x0), np.full(50, x1)]).clip(0, red.shape[1] - 1).astype(int)
    rows = np.concatenate([np.full(50, y0), np.full(50, y1), y, y]).clip(0, red.shape[0] - 1).astype(int)
    return float(red[rows, columns].mean())
