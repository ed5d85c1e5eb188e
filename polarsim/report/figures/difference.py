"""How a twin differs from its photo, as a picture, as numbers, and the bar that says what colours mean."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from polarsim.photo import BLACK_LEVEL
from polarsim.scoring.twins import FULL_DN, LIT_DN

STOPS = 2.0  # of full colour
TONES = 0.5  # of full colour, share of white, where tones were matched
_LEVELS = np.linspace(0, 1, 257)
STOPS_MEANING = "log2 of twin over photo, stops; red: twin too bright\ngrey: left out, dark or clipped in photo or twin"
TONES_MEANING = "tone of twin less photo, of white; red: twin too bright\ngrey: left out, lines drawn into the photo"


def difference_of_photo(photo: np.ndarray, twin: np.ndarray) -> np.ndarray:
    """(h, w, 3) uint8 picture of log2(twin / photo) of 12-bit pictures (h, w); grey where either is dark or clipped."""
    ratio, good = _log2(photo, twin)
    return _coloured(ratio / STOPS, good)


def log2_over_photo(photo: np.ndarray, twin: np.ndarray) -> np.ndarray:
    """(n,) log2(twin / photo) of the pixels that are neither dark nor clipped in either."""
    ratio, good = _log2(photo, twin)
    return ratio[good]


def _log2(photo: np.ndarray, twin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(h, w) log2(twin / photo), and where both are neither dark nor clipped."""
    signals = [picture.astype(np.float32) - BLACK_LEVEL for picture in (photo, twin)]
    good = np.logical_and.reduce([(signal > LIT_DN) & (signal < FULL_DN) for signal in signals])
    return np.log2(np.divide(signals[1], signals[0], where=good, out=np.ones_like(signals[0]))), good


def difference_of_cover(cover: np.ndarray, twin: np.ndarray, red: np.ndarray) -> np.ndarray:
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
    own, first = np.unique(np.quantile(twin[~red], _LEVELS), return_index=True)
    matched = np.interp(twin, own, wanted[first])
    return _coloured((matched - tones) / TONES, ~red)


def _coloured(share: np.ndarray, good: np.ndarray) -> np.ndarray:
    """-1 is blue, 0 white, 1 red."""
    share = np.clip(share, -1, 1)
    fade = 1 - np.abs(share)
    channels = [np.where(share > 0, 1, fade), fade, np.where(share < 0, 1, fade)]
    return np.where(good[..., None], np.round(255 * np.stack(channels, axis=-1)), 128).astype(np.uint8)


def difference_bar(figure: Any, axes: Sequence[Any], full: float = STOPS, meaning: str = STOPS_MEANING) -> None:
    """A bar below a difference that says what its colours mean; `full` is the value of full colour."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LinearSegmentedColormap, Normalize

    colours = LinearSegmentedColormap.from_list("difference", ["#0000ff", "#ffffff", "#ff0000"])
    shown = ScalarMappable(Normalize(-full, full), colours)
    bar = figure.colorbar(shown, ax=list(axes), location="bottom", fraction=0.05, pad=0.02, aspect=50, extend="both")
    bar.set_label(meaning, fontsize="small")
    bar.ax.tick_params(labelsize="small")
