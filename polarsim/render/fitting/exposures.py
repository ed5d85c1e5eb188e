"""Linear images from exposure brackets, and images of single lamps from photos with several lamps."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError, PolarsimError
from polarsim.formats import png
from polarsim.geometry.lens import Lens
from polarsim.photo import BLACK_LEVEL, ELECTRONS_PER_DN, WHITE_LEVEL, PhotoKey
from polarsim.render.lamps import ROVER, lamps_on

log = logging.getLogger("polarsim.render")
Reader = Callable[[Path, tuple[int, int]], np.ndarray]  # path and (width, height) -> 12-bit photo (h, w)

_FULL = WHITE_LEVEL - BLACK_LEVEL - 200  # DN above black up to which the sensor is linear
_DARK = 4  # DN above black, below which a pixel has no information
_PER_GREY = 1 / ELECTRONS_PER_DN  # variance of shot noise over the signal, DN
_WHOLE = 0.999  # minimum share of defined pixels under a pixel of a smaller image
_READ = 0.9  # standard deviation of read noise and rounding, DN


@dataclass(frozen=True)
class Linear:
    """Linear image of an exposure bracket, (h, w) float32: rate, DN per ms, and variance, infinite if undefined."""

    rate: np.ndarray
    variance: np.ndarray

    def resized(self, lens: Lens) -> Linear:
        """Return the image at the smaller size of a lens, averaged over pixels; undefined pixels spread."""
        import cv2

        size = (lens.width, lens.height)
        if self.rate.shape == lens.shape:
            return self
        defined = np.isfinite(self.variance)
        rate, variance, share = (
            cv2.resize(values.astype(np.float32), size, interpolation=cv2.INTER_AREA)
            for values in (self.rate, np.where(defined, self.variance, 0), defined)
        )
        pixels = self.rate.size / rate.size
        return Linear(rate, np.where(share > _WHOLE, variance / np.float32(pixels), np.inf).astype(np.float32))

    def less(self, other: Linear) -> Linear:
        """Subtract the light of another exposure bracket."""
        return Linear(self.rate - other.rate, self.variance + other.variance)


def merge_exposures(photos: Iterable[tuple[np.ndarray, float]]) -> Linear | None:
    """Merge 12-bit photos (h, w) with exposure times, ms, into a linear image; None without photos.

    Photos are weighted by their noise (maximum-likelihood weights of Robertson et al., ICIP 1999). Clipped and nearly
    black values are excluded.
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


def read_published_photo(path: Path, size: tuple[int, int]) -> np.ndarray:
    """Read a published photo of 8 bits, grey or colour, as 12-bit values (h, w) uint16: the lower 4 bits are lost."""
    pixels = png.read_png(path)
    grey = pixels if pixels.ndim == 2 else pixels[..., 0]  # the colours of a grey image are equal
    if pixels.dtype != np.uint8 or grey.shape != size[::-1]:
        raise FormatError(f"{pixels.dtype} {grey.shape}, expected {size[0]} x {size[1]} pixels of 8 bits", path=path)
    return grey.astype(np.uint16) << 4


def single_lamps(
    paths: Mapping[PhotoKey, Path], lens: Lens, suns: Sequence[str], read: Reader = png.read_photo
) -> dict[str, Linear]:
    """Return linear images of single lamps, from the photos of a view; lamps without photos are omitted.

    `suns`: names of the Sun lamps of the site, in the order of the result. `read`: function that reads a photo of 12
    bits, given path and size.

    Images of Sun lamps are merged from photos without the rover light. The image of the rover light is merged from
    photos without a Sun lamp if available, else from differences of photos with and without the rover light.
    """
    sets: dict[tuple[str, ...], list[PhotoKey]] = {}
    for key in sorted(paths):
        sets.setdefault(lamps_on(key), []).append(key)
    images: dict[str, Linear] = {}
    for name in (*suns, ROVER):
        image = merge_exposures(_photos(sets.get((name,), []), paths, lens, read))
        if image is not None:
            images[name] = image
    if ROVER in images:
        return images
    differences = []
    for name in (name for name in suns if name in images):
        both = merge_exposures(_photos(sets.get((name, ROVER), []), paths, lens, read))
        if both is not None:
            differences.append(both.less(images[name]))
    if differences:
        images[ROVER] = mean_of(differences)
    return images


def mean_of(images: Sequence[Linear]) -> Linear:
    """Return the mean of images of the same light, weighted by inverse variance."""
    certainty = sum((1 / image.variance for image in images), np.zeros_like(images[0].rate))
    total = sum((image.rate / image.variance for image in images), np.zeros_like(certainty))
    with np.errstate(divide="ignore", invalid="ignore"):
        return Linear(np.where(certainty > 0, total / certainty, 0).astype(np.float32), 1 / certainty)


def _photos(
    keys: Iterable[PhotoKey], paths: Mapping[PhotoKey, Path], lens: Lens, read: Reader
) -> Iterable[tuple[np.ndarray, float]]:
    for key in keys:
        try:
            yield read(paths[key], (lens.width, lens.height)), key.exposure_ms
        except PolarsimError as error:
            log.warning("%s; the photo is not fitted", error)
