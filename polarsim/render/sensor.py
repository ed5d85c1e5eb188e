"""From radiance to the 12 bits of a photo."""

from __future__ import annotations

from typing import Any

import numpy as np

from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL
from polarsim.randomness import generator
from polarsim.render.options import RenderOptions
from polarsim.render.sensor_options import SensorOptions


def noise_seed(options: RenderOptions, *picture: object) -> tuple[Any, ...]:
    """What `randomness.generator` makes a picture's noise of; empty where the options ask for none."""
    return (options.seed, "sensor", *picture) if options.noise else ()


def noise_of(options: RenderOptions, *picture: object) -> np.random.Generator | None:
    """The noise of a picture, the same whenever it is made; None where the options ask for none."""
    seed = noise_seed(options, *picture)
    return generator(*seed) if seed else None


def expose(
    radiance: np.ndarray, dn_per_radiance: float, options: SensorOptions, noise: np.random.Generator | None = None
) -> np.ndarray:
    """(h, w) uint16 photo of radiance (h, w): black level + `dn_per_radiance` * radiance, noise if given, 12 bits.

    `dn_per_radiance` is exposure time times gain. The noise is normal, its variance in electrons that of their count
    and of the reading: the photon transfer curve (Janesick, Photon Transfer, SPIE 2007).
    """
    signal = radiance * np.float32(dn_per_radiance)
    if noise is not None:
        per_dn = np.float32(options.electrons_per_dn)
        electrons = per_dn * np.minimum(signal, np.float32(2 * WHITE_LEVEL))
        spread = np.sqrt(electrons + np.float32(options.read_noise_electrons**2)) / per_dn
        signal = signal + spread * noise.standard_normal(signal.shape, np.float32)
    signal += np.float32(BLACK_LEVEL + 0.5)  # truncation then rounds
    return np.clip(signal, 0, WHITE_LEVEL + 0.5, out=signal).astype(np.uint16)
