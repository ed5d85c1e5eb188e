"""From radiance to the 12 bits of a photo."""

from __future__ import annotations

import numpy as np

from polarsim.geometry.lens import Lens
from polarsim.geometry.pixel_rays import pixel_directions
from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL

_ELECTRONS_PER_GREY_VALUE = 8.0  # of a sensor like NASA's (Sony IMX249 family)
_READ_NOISE = 7.0  # electrons


def expose(radiance: np.ndarray, light: float, noise: np.random.Generator | None = None) -> np.ndarray:
    """(h, w) uint16 photo of radiance (h, w): black level + light * radiance, with noise if asked for, clipped.

    `light` is exposure times gain: grey values for a radiance of 1.
    """
    signal = radiance * np.float32(light)
    if noise is not None:
        electrons = np.float32(_ELECTRONS_PER_GREY_VALUE) * np.minimum(signal, np.float32(2 * WHITE_LEVEL))
        spread = np.sqrt(electrons + np.float32(_READ_NOISE**2)) / np.float32(_ELECTRONS_PER_GREY_VALUE)
        signal = signal + spread * noise.standard_normal(signal.shape, np.float32)
    signal += np.float32(BLACK_LEVEL + 0.5)  # truncation then rounds
    return np.clip(signal, 0, WHITE_LEVEL + 0.5).astype(np.uint16)


def vignette(lens: Lens) -> np.ndarray:
    """(h, w) float32 share of light that reaches a pixel: the fourth power of the cosine to the optical axis."""
    directions = pixel_directions(lens, slice(None))
    return (1 / (directions**2).sum(axis=-1) ** 2).astype(np.float32)
