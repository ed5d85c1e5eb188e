"""One linear picture from the photos of an exposure bracket, and those of single lamps from sums of lamps."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from polarsim.errors import PolarsimError
from polarsim.formats import png
from polarsim.geometry.lens import Lens
from polarsim.photo import BLACK_LEVEL, ELECTRONS_PER_DN, SUNS, WHITE_LEVEL, PhotoKey
from polarsim.render.lamps import ROVER, lit_by

log = logging.getLogger("polarsim.render")

_FULL = WHITE_LEVEL - BLACK_LEVEL - 200  # grey values above black that no sensor clips or bends
_DARK = 4  # grey values above black, below which a pixel tells nothing
_PER_GREY = 1 / ELECTRONS_PER_DN  # variance of a grey value by the light's own noise, over that value
_READ = 0.9  # sd of the read noise and of rounding, grey values


@dataclass(frozen=True)
class Linear:
    """Light of an exposure bracket, (h, w) float32: grey values per ms, and its variance; infinite where nothing is
    known.
    """

    rate: np.ndarray
    variance: np.ndarray

    def less(self, other: Linear) -> Linear:
        """The light that the other exposure bracket lacks."""
        return Linear(self.rate - other.rate, self.variance + other.variance)


def merged(photos: Iterable[tuple[np.ndarray, float]]) -> Linear | None:
    """The linear picture of photos (h, w) of 12-bit grey values with their exposures in ms; None without any.

    Every photo counts by its noise (the maximum-likelihood weights of Robertson et al., ICIP 1999); clipped and nearly
    black values do not count.
    """
    total: np.ndarray | None = None
    for photo, exposure_ms in photos:
        if total is None:
            total, weights = np.zeros(photo.shape), np.zeros(photo.shape)
        signal = photo.astype(float) - BLACK_LEVEL
        usable = (signal > _DARK) & (signal < _FULL)
        weight = np.where(usable, exposure_ms**2 / (_READ**2 + _PER_GREY * np.maximum(signal, 0)), 0)
        total += weight * signal / exposure_ms
        weights += weight
    if total is None:
        return None
    with np.errstate(divide="ignore", invalid="ignore"):
        return Linear(np.where(weights > 0, total / weights, 0).astype(np.float32), (1 / weights).astype(np.float32))


def single_lamps(paths: Mapping[PhotoKey, Path], lens: Lens) -> dict[str, Linear]:
    """The light of every lamp alone in one view, from the photos of that view; lamps that none shows are left out.

    Sun lamps come from photos without the rover light. The rover light comes from photos of it alone, else from those
    of Sun lamps with it and without it.
    """
    sets: dict[tuple[str, ...], list[PhotoKey]] = {}
    for key in sorted(paths):
        sets.setdefault(lit_by(key), []).append(key)
    found: dict[str, Linear] = {}
    for name in (*SUNS, ROVER):
        own = merged(_photos(sets.get((name,), []), paths, lens))
        if own is not None:
            found[name] = own
    if ROVER in found:
        return found
    differences = []
    for name in (name for name in SUNS if name in found):
        both = merged(_photos(sets.get((name, ROVER), []), paths, lens))
        if both is not None:
            differences.append(both.less(found[name]))
    if differences:
        found[ROVER] = mean_of(differences)
    return found


def mean_of(pictures: Sequence[Linear]) -> Linear:
    """The mean of pictures of the same light, by their noise."""
    certainty = sum((1 / picture.variance for picture in pictures), np.zeros_like(pictures[0].rate))
    total = sum((picture.rate / picture.variance for picture in pictures), np.zeros_like(certainty))
    with np.errstate(divide="ignore", invalid="ignore"):
        return Linear(np.where(certainty > 0, total / certainty, 0).astype(np.float32), 1 / certainty)


def _photos(keys: Iterable[PhotoKey], paths: Mapping[PhotoKey, Path], lens: Lens) -> Iterable[tuple[np.ndarray, float]]:
    for key in keys:
        try:
            yield png.read_photo(paths[key], (lens.width, lens.height)), key.exposure_ms
        except PolarsimError as error:
            log.warning("%s; materials are fitted without it", error)
