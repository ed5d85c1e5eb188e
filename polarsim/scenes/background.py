"""Background of scenes: the dark hall behind the walls of the sandbox.

Detectors that have never seen it find rocks in it. Cloth, cards and glare of the lens were tried too and made
detectors no better on photos (docs/notes/detect.md).
"""

from __future__ import annotations

import numpy as np

from polarsim.geometry.heightfields import smooth_noise
from polarsim.scenes.options import Range


def add_background(
    radiance: np.ndarray, bare: np.ndarray, brightness: Range, random: np.random.Generator
) -> np.ndarray:
    """Return radiance (h, w) float32 over that of lit sand, the hall added in the unlit pixels `bare` (h, w)."""
    if bare.any():
        radiance = radiance + np.where(bare, random.uniform(*brightness) * draw_hall(bare.shape, random), 0)
    return np.asarray(radiance, np.float32)


def draw_hall(shape: tuple[int, ...], random: np.random.Generator) -> np.ndarray:
    """Return (h, w) brightness of folds of cloth and of upright and level bars, mean 1."""
    height, width = shape
    folds = np.exp(0.5 * smooth_noise((height, width), height / 4, width / 200, np.pi / 2, random))
    for _ in range(random.integers(8)):
        row, column = random.integers(height), random.integers(width)
        high, wide = random.integers(2, 60, 2)
        folds[row : row + high, column : column + wide] *= random.uniform(0, 4)
    return np.asarray(folds / folds.mean())
