"""How a twin differs from what it copies, pixel by pixel: red where the twin is brighter, blue where it is darker."""

from __future__ import annotations

import numpy as np

from polarsim.photo import BLACK_LEVEL
from polarsim.scoring.twins import FULL_DN, LIT_DN

STOPS = 2.0  # of full colour
_TONES = 0.5  # of full colour, share of white, where tones were matched
_LEVELS = np.linspace(0, 1, 257)


def of_photo(photo: np.ndarray, twin: np.ndarray) -> np.ndarray:
    """(h, w, 3) uint8 picture of log2(twin / photo) of 12-bit pictures (h, w); grey where either is dark or clipped."""
    signals = [picture.astype(np.float32) - BLACK_LEVEL for picture in (photo, twin)]
    good = np.logical_and.reduce([(signal > LIT_DN) & (signal < FULL_DN) for signal in signals])
    ratio = np.log2(np.divide(signals[1], signals[0], where=good, out=np.ones_like(signals[0])))
    return _coloured(ratio / STOPS, good)


def of_cover(cover: np.ndarray, twin: np.ndarray, red: np.ndarray) -> np.ndarray:
    """(h, w, 3) uint8 picture of tones, twin less cover photo, once the twin has the distribution of its tones.

    Published covers are stretched in ways that nobody wrote down, so that brightness itself cannot be compared.

    Parameters
    ----------
    cover : (h, w, 3) uint8
    twin : (h, w) uint16
    red : (h, w) bool
        Where lines or digits were drawn into the cover: left grey.
    """
    tones = cover.astype(np.float32).mean(axis=-1) / 255
    wanted = np.quantile(tones[~red], _LEVELS)
    own, places = np.unique(np.quantile(twin[~red], _LEVELS), return_index=True)
    matched = np.interp(twin, own, wanted[places])
    return _coloured((matched - tones) / _TONES, ~red)


def _coloured(share: np.ndarray, good: np.ndarray) -> np.ndarray:
    """-1 is blue, 0 white, 1 red."""
    share = np.clip(share, -1, 1)
    fade = 1 - np.abs(share)
    channels = [np.where(share > 0, 1, fade), fade, np.where(share < 0, 1, fade)]
    return np.where(good[..., None], np.round(255 * np.stack(channels, axis=-1)), 128).astype(np.uint8)
