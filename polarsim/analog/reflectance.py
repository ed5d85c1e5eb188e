"""How surfaces reflect: rough matte grains, an opposition surge, a forward lobe and, on some stones, gloss.

Oren and Nayar, SIGGRAPH 1994, in Fujii's form without angles. Neither of the twins' models is it: those are Hapke's and
Burley's.
"""

from __future__ import annotations

import numpy as np

from polarsim.analog.rays import lengths

# By material (sand, rock, cloth, dark, grey, white, floor, curtain, metal).
_ROUGHNESS = np.radians([18, 22, 12, 25, 10, 5, 20, 25, 15]).astype(np.float32)  # sd of facet slopes
_SURGE = np.array([0.55, 0.35, 0.10, 0.1, 0.02, 0.02, 0.1, 0.1, 0.0], np.float32)  # height of the opposition surge
_SURGE_WIDTH = np.array([0.09, 0.06, 0.05, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1], np.float32)  # tan of half its half-width
_FORWARD = np.array(
    [5.0, 0.4, 0.2, 0.2, 0, 0, 0.5, 0.2, 0], np.float32
)  # grazing light scattered onwards, by glassy grains
_FORWARD_POWER = 8
_GLOSS_POWER = 30


def reflect(
    material: np.ndarray, albedo: np.ndarray, gloss: np.ndarray, normals: np.ndarray, to_light: np.ndarray,
    to_eye: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """BRDF times the cosine of incidence, 1/sr; 0 where light or eye lie behind the surface.

    Parameters
    ----------
    material, albedo, gloss : (...)
        Material numbers, hemispherical albedo of the matte part, strength of the shiny one.
    normals, to_light, to_eye : (..., 3) float32
        Unit vectors.
    """
    cos_i = np.einsum("...k,...k->...", normals, to_light)
    cos_e = np.maximum(np.einsum("...k,...k->...", normals, to_eye), 0.02)
    cos_phase = np.clip(np.einsum("...k,...k->...", to_light, to_eye), -1, 1)
    variance = _ROUGHNESS[material] ** 2
    s = cos_phase - cos_i * cos_e
    t = np.where(s > 0, np.maximum(cos_i, cos_e), 1)
    matte = 1 - 0.5 * variance / (variance + 0.33) + 0.45 * variance / (variance + 0.09) * s / np.maximum(t, 0.02)
    half_phase = np.sqrt((1 - cos_phase) / (1 + cos_phase + 1e-6))
    surge = 1 + _SURGE[material] / (1 + half_phase / _SURGE_WIDTH[material])
    onwards = 1 + _FORWARD[material] * (0.5 - 0.5 * cos_phase) ** _FORWARD_POWER
    brdf = albedo / np.float32(np.pi) * matte * surge * onwards
    if gloss.any():
        half = to_light + to_eye
        half /= np.maximum(lengths(half), 1e-6)[..., None]
        shine = np.maximum(np.einsum("...k,...k->...", normals, half), 0) ** _GLOSS_POWER
        brdf = brdf + np.float32(0.1) * gloss * shine
    return np.where(cos_i > 0, brdf * cos_i, 0).astype(np.float32)
