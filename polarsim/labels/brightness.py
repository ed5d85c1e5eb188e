"""Brightness in the photos of a terrain, all exposures of a bracket as one picture, and what stands out in it."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from polarsim.errors import PolarsimError
from polarsim.formats import png
from polarsim.geometry.boxes import window
from polarsim.geometry.lens import HALF_PIXEL
from polarsim.photo import (
    BLACK_LEVEL,
    ELECTRONS_PER_DN,
    READ_NOISE_ELECTRONS,
    WHITE_LEVEL,
    Azimuth,
    CameraSide,
    Light,
)
from polarsim.run_files.pictures import pictures_at

log = logging.getLogger("polarsim")

Bracket = tuple[str, CameraSide, Light, Azimuth]  # of one terrain: position, camera, light, azimuth

READ_NOISE_DN = READ_NOISE_ELECTRONS / ELECTRONS_PER_DN
KEPT = 4  # pictures in memory: 10 MB each
FULL = WHITE_LEVEL - BLACK_LEVEL - 100.0  # above this a pixel may be clipped
SURROUND = 0.35  # of a box's sides: the width of the frame around it with which it is compared
INNER = 0.8  # of a box's sides: the ellipse in which the thing itself is


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
        self.sets: dict[Bracket, list[tuple[int, Path]]] = {}
        for key, path in sorted(pictures_at(index).items()):
            if key.terrain == terrain:
                own = self.sets.setdefault((key.position, key.camera, key.light, key.azimuth), [])
                own.append((key.exposure_ms, path))

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


@dataclass(frozen=True)
class Contrast:
    """How far a thing stands out of its surround: in grey values, and in units of a pixel's noise."""

    dn: float
    noises: float


NONE = Contrast(0.0, 0.0)


def contrast(brightness: Brightness, box: np.ndarray, exposure_ms: float) -> Contrast:
    """How far what a box (4,) frames stands out of its surround: root mean square difference.

    A rock has a lit and a dark side, so that its mean may be that of the sand: every pixel is compared with the
    median of the surround, and what noise alone adds is taken off.
    """
    height, width = brightness.rate.shape
    part = window(box, np.maximum((box[2:] - box[:2]) * SURROUND, 3.0), width, height)
    y, x = (np.arange(side.start, side.stop) + HALF_PIXEL for side in part)
    if min(len(x), len(y)) < 2:
        return NONE
    values = brightness.at(exposure_ms, part)
    centre, half = (box[:2] + box[2:]) / 2, np.maximum((box[2:] - box[:2]) / 2, 0.5)
    inner = (((y - centre[1]) / half[1]) ** 2)[:, None] + ((x - centre[0]) / half[0]) ** 2 < INNER**2
    framed = ((y > box[1]) & (y < box[3]))[:, None] & ((x > box[0]) & (x < box[2]))
    if not inner.any() or framed.all():
        return NONE
    surround = float(np.median(values[~framed]))
    noise = float(noise_dn(surround))
    excess = float(((values[inner] - surround) ** 2).mean()) - noise**2
    dn = float(np.sqrt(max(excess, 0.0)))
    return Contrast(dn, dn / noise)
