"""Linear image of an exposure bracket."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from polarsim.errors import PolarsimError
from polarsim.formats import png
from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL

log = logging.getLogger("polarsim")
CLIPPED_DN = WHITE_LEVEL - BLACK_LEVEL - 100.0  # signal above which a pixel may be clipped


def read_rate(
    photos: Iterable[tuple[int, Path]], size: tuple[int, int] | None, skipped: str
) -> tuple[np.ndarray | None, tuple[int, ...]]:
    """Return grey values above black per millisecond (h, w) float32, and the exposures of the readable photos, ms.

    Each pixel is taken from the longest exposure in which it is not clipped. Pixels that are clipped in the shortest
    exposure have a lower bound.

    `photos`: exposure time, ms, and file of each photo, shortest first. `size`: width and height, px; None: those of
    the first photo. `skipped`: use of the photos, for the warning about an unreadable photo.
    """
    rate: np.ndarray | None = None
    exposures = []
    for exposure, path in photos:
        try:
            signal = png.read_photo(path, size).astype(np.float32) - BLACK_LEVEL
        except PolarsimError as error:
            log.warning("%s: photo %s", error, skipped)
            continue
        size = (signal.shape[1], signal.shape[0])
        rate = signal / exposure if rate is None else np.where(signal < CLIPPED_DN, signal / exposure, rate)
        exposures.append(exposure)
    return rate, tuple(exposures)
