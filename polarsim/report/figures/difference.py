"""Brightness difference of twin and photo: image, values, colour bar."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from polarsim.photo import BLACK_LEVEL
from polarsim.report.figures.canvas import rgb
from polarsim.scoring.appearance import FULL_DN, LIT_DN

STOPS = 3.0  # difference at the saturated colour, stops
TONES = 0.5  # difference at the saturated colour after tone matching, share of white
COLOURS = ("#053061", "#4393c3", "#f7f7f7", "#d6604d", "#67001f")  # ColorBrewer's RdBu, for colour-blind readers
_SHADES = 127  # number of shades from the middle to either end
_LEVELS = np.linspace(0, 1, 257)
STOPS_MEANING = "log2(twin / photo), stops; red: twin too bright\ngrey: excluded (dark or clipped in photo or twin)"
TONES_MEANING = "tone of twin minus photo, share of white; red: twin too bright\ngrey: excluded (lines in the photo)"


def difference_of_photo(photo: np.ndarray, twin: np.ndarray) -> np.ndarray:
    """Return an image (h, w, 3) uint8 of log2(twin / photo) of 12-bit images (h, w); grey where dark or clipped."""
    ratio, good = _log2(photo, twin)
    return _coloured(ratio / STOPS, good)


def log2_over_photo(photo: np.ndarray, twin: np.ndarray) -> np.ndarray:
    """Return log2(twin / photo) (n,) of the pixels that are not dark or clipped in photo or twin."""
    ratio, good = _log2(photo, twin)
    return ratio[good]


def _log2(photo: np.ndarray, twin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return log2(twin / photo) (h, w), and the mask of pixels that are not dark or clipped in photo or twin."""
    signals = [picture.astype(np.float32) - BLACK_LEVEL for picture in (photo, twin)]
    good = np.logical_and.reduce([(signal > LIT_DN) & (signal < FULL_DN) for signal in signals])
    return np.log2(np.divide(signals[1], signals[0], where=good, out=np.ones_like(signals[0]))), good


def difference_of_cover(cover: np.ndarray, twin: np.ndarray, red: np.ndarray) -> np.ndarray:
    """Return an image (h, w, 3) uint8 of the tone difference, twin minus cover photo, after histogram matching.

    The tone curves of published cover photos are not documented, so absolute brightness cannot be compared. Types are
    uint8 of `cover` (h, w, 3), uint16 of `twin` (h, w) and bool of `red` (h, w), the red lines and digits of the cover
    photo, which are grey in the result.
    """
    tones = cover.astype(np.float32).mean(axis=-1) / 255
    wanted = np.quantile(tones[~red], _LEVELS)
    levels, first = np.unique(np.quantile(twin[~red], _LEVELS), return_index=True)
    return difference_of_tones(tones, np.interp(twin, levels, wanted[first]), ~red)


def difference_of_tones(photo: np.ndarray, twin: np.ndarray, compared: np.ndarray) -> np.ndarray:
    """Return an image (h, w, 3) uint8 of twin minus photo, both (h, w) as share of white; grey where not compared."""
    return _coloured((twin - photo) / TONES, compared)


def _coloured(share: np.ndarray, good: np.ndarray) -> np.ndarray:
    """Map -1 to blue, 0 to white, 1 to red; grey where not `good`."""
    shade = np.rint(_SHADES * np.nan_to_num(share).clip(-1, 1)).astype(np.int16) + _SHADES
    return _palette().take(np.where(good, shade, 2 * _SHADES + 1), axis=0)


@cache
def _palette() -> np.ndarray:
    """Return the colours (n, 3) uint8 from -1 to 1, and grey."""
    anchors = [rgb(colour) for colour in COLOURS]
    at = np.linspace(0, len(anchors) - 1, 2 * _SHADES + 1)
    shades = np.stack([np.interp(at, np.arange(len(anchors)), channel) for channel in zip(*anchors, strict=True)], -1)
    return np.concatenate([np.rint(shades), [[128] * 3]]).astype(np.uint8)


def difference_bar(figure: Any, axes: Sequence[Any], full: float = STOPS, meaning: str = STOPS_MEANING) -> None:
    """Draw a colour bar below difference images; `full` is the value of the saturated colour."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LinearSegmentedColormap, Normalize

    colours = LinearSegmentedColormap.from_list("difference", COLOURS)
    shown = ScalarMappable(Normalize(-full, full), colours)
    bar = figure.colorbar(shown, ax=list(axes), location="bottom", fraction=0.05, pad=0.02, aspect=40, extend="both")
    bar.set_label(meaning, fontsize="small")
    bar.ax.tick_params(labelsize="small")
