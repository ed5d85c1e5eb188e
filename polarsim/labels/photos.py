"""What the photos of a terrain tell about brightness: all exposures of an exposure bracket as one picture."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from polarsim.errors import PolarsimError
from polarsim.formats import png, tables
from polarsim.photo import (
    BLACK_LEVEL,
    ELECTRONS_PER_DN,
    READ_NOISE_ELECTRONS,
    WHITE_LEVEL,
    Azimuth,
    CameraSide,
    Light,
    PhotoKey,
)

log = logging.getLogger("polarsim")

Bracket = tuple[str, CameraSide, Light, Azimuth]  # of one terrain: position, camera, light, azimuth

READ_NOISE_DN = READ_NOISE_ELECTRONS / ELECTRONS_PER_DN
KEPT = 4  # pictures in memory: 10 MB each
FULL = WHITE_LEVEL - BLACK_LEVEL - 100.0  # above this a pixel may be clipped


@dataclass(frozen=True)
class Brightness:
    """(h, w) float32 grey values above black a millisecond, and the exposures (ms) that the exposure bracket has."""

    rate: np.ndarray
    exposures_ms: tuple[int, ...]

    def at(self, exposure_ms: float, part: tuple[slice, slice] = (slice(None), slice(None))) -> np.ndarray:
        """Grey values above black of a part of the photo of an exposure, without noise, clipped as photos are."""
        return np.minimum(self.rate[part] * exposure_ms, WHITE_LEVEL - BLACK_LEVEL)


def noise_dn(signal_dn: np.ndarray | float) -> np.ndarray:
    """Standard deviation of a pixel whose mean is `signal_dn` above black: photons and read-out."""
    return np.sqrt(np.maximum(signal_dn, 0.0) / ELECTRONS_PER_DN + READ_NOISE_DN**2)


class Photos:
    """The photos of one terrain, read when they are asked for; none is a source without photos."""

    def __init__(self, index: Path, terrain: int) -> None:
        table = tables.read_parquet(index, ("key", "path"))
        self.sets: dict[Bracket, list[tuple[int, Path]]] = {}
        for name, path in sorted(zip(table["key"], table["path"], strict=True)):
            key = PhotoKey.parse(str(name))
            if key.terrain == terrain:
                own = self.sets.setdefault((key.position, key.camera, key.light, key.azimuth), [])
                own.append((key.exposure_ms, Path(path)))

        self.brightness = lru_cache(maxsize=KEPT)(self._brightness)

    def _brightness(self, bracket: Bracket) -> Brightness | None:
        """Every pixel from the longest exposure that did not clip it; None without a readable photo."""
        rate: np.ndarray | None = None
        found = []
        for exposure, path in sorted(self.sets.get(bracket, [])):
            try:
                signal = png.read_photo(path).astype(np.float32) - BLACK_LEVEL
            except PolarsimError as error:
                log.warning("%s: not looked at for labels", error)
                continue
            rate = signal / exposure if rate is None else np.where(signal < FULL, signal / exposure, rate)
            found.append(exposure)
        return None if rate is None else Brightness(rate, tuple(found))
