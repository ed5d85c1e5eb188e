"""Background of scenes: the dark hall behind the walls of the sandbox.

Detectors trained without it report rocks in it. Cloth, cards and lens glare had no effect on the results on photos
(docs/notes/detect.md).
"""

from __future__ import annotations

import numpy as np

from polarsim.geometry.heightfields import smooth_noise
from polarsim.scenes.options import Range


def add_background(
    radiance: np.ndarray, bare: np.ndarray, brightness: Range, random: np.random.Generator
) -> np.ndarray:
    """Return the radiance (h, w) float32, relative to lit sand, with the hall added at the unlit pixels `bare`."""
    if bare.any():
        radiance = radiance + np.where(bare, random.uniform(*brightness) * draw_hall(bare.shape, random), 0)
    return np.asarray(radiance, np.float32)


def draw_hall(shape: tuple[int, ...], random: np.random.Generator) -> np.ndarray:
    """Return the brightness (h, w) of folds of cloth and of vertical and horizontal bars, with mean 1."""
    height, width = shape
    folds = np.exp(0.5 * smooth_noise((height, width), height / 4, width / 200, np.pi / 2, random))
    for _ in range(random.integers(8)):
        row, column = random.integers(height), random.integers(width)
        high, wide = random.integers(2, 60, 2)
        folds[row : row + high, column : column + wide] *= random.uniform(0, 4)
    return np.asarray(folds / folds.mean())
