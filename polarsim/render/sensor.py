"""Sensor model: conversion of radiance to 12-bit DN."""

from __future__ import annotations

from typing import Any

import numpy as np

from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL
from polarsim.randomness import generator
from polarsim.render.options import RenderOptions, SensorOptions


def noise_seed(options: RenderOptions, *picture: object) -> tuple[Any, ...]:
    """Return the arguments of `randomness.generator` for the noise of an image; empty if noise is off."""
    return (options.seed, "sensor", *picture) if options.noise else ()


def noise_generator(options: RenderOptions, *picture: object) -> np.random.Generator | None:
    """Return the random generator of the noise of an image; None if noise is off."""
    seed = noise_seed(options, *picture)
    return generator(*seed) if seed else None


def expose(
    radiance: np.ndarray, dn_per_radiance: float, options: SensorOptions, noise: np.random.Generator | None = None
) -> np.ndarray:
    """Return the 12-bit photo (h, w) uint16 of radiance (h, w): black level + `dn_per_radiance` * radiance + noise.

    `dn_per_radiance` is exposure time times gain. The noise is Gaussian with the variance of shot noise plus read noise
    (photon transfer curve; Janesick, Photon Transfer, SPIE 2007).
    """
    signal = radiance * np.float32(dn_per_radiance)
    if noise is not None:
        per_dn = np.float32(options.electrons_per_dn)
        electrons = per_dn * np.minimum(signal, np.float32(2 * WHITE_LEVEL))
        spread = np.sqrt(electrons + np.float32(options.read_noise_electrons**2)) / per_dn
        signal = signal + spread * noise.standard_normal(signal.shape, np.float32)
    signal += np.float32(BLACK_LEVEL + 0.5)  # truncation then rounds
    return np.clip(signal, 0, WHITE_LEVEL + 0.5, out=signal).astype(np.uint16)
