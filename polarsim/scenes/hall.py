"""What photos show beside sand and rocks, drawn into pictures at random: hall, cloth, cards, glare.

Detectors that have never seen such things find rocks in them; but those of cloth, cards and glare were no better on
real photos (docs/notes/detect.md), so only the hall is there by default.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from polarsim.scenes.options import HallOptions
from polarsim.scenes.relief import smooth_noise

_BEFORE_WALL_M = 0.03  # a card's distance from the wall that it leans on
_GLARE_SHARE = (0.02, 0.1)  # standard deviation of a blob of glare over the picture's width, as on cover photos
_FRACTION_BITS = 4  # bits of a pixel's fraction in OpenCV's polygons


def furnish(
    radiance: np.ndarray,
    around: np.ndarray,
    bare: np.ndarray,
    walls: tuple[float, float],
    project: Callable[[np.ndarray], np.ndarray],
    options: HallOptions,
    random: np.random.Generator,
) -> np.ndarray:
    """Radiance (h, w), in units of lit sand's, with what is around the sand; sand and rocks get glare alone.

    Parameters
    ----------
    around : (h, w) bool
        Walls and what is behind them.
    bare : (h, w) bool
        The part of `around` that has no light of its own.
    walls : (float, float)
        Half the width of the sandbox, and the height of the walls' tops, sandbox metres.
    project : points (n, 3) in the sandbox to pixels (n, 2)
    """
    shape = (radiance.shape[0], radiance.shape[1])
    seen = radiance
    if bare.any():
        seen = seen + np.where(bare, random.uniform(*options.brightness) * draw_hall(shape, random), 0)
    if any(options.folds_sd):
        folds = smooth_noise(shape, shape[0] / 6, shape[1] / 150, random.uniform(0, np.pi), random)
        seen = np.where(around & ~bare, seen * np.exp(random.uniform(*options.folds_sd) * folds), seen)
    for _ in range(random.integers(options.most_cards + 1)):
        corners = _card(walls, options, random)
        for outline in (corners, _within(corners, random.uniform(0.75, 0.95))):
            seen = np.where(around & _filled(project(outline), shape), random.uniform(*options.card), seen)
    for _ in range(random.integers(options.most_glares + 1)):
        seen = seen + random.uniform(*options.glare) * _blob(shape, random.uniform(*_GLARE_SHARE), random)
    return np.asarray(seen, np.float32)


def draw_hall(shape: tuple[int, int], random: np.random.Generator) -> np.ndarray:
    """(h, w) brightness of the dark hall behind the walls: folds of cloth, upright and level bars; mean 1."""
    folds = np.exp(0.5 * smooth_noise(shape, shape[0] / 4, shape[1] / 200, np.pi / 2, random))
    for _ in range(random.integers(8)):
        row, column = random.integers(shape[0]), random.integers(shape[1])
        high, wide = random.integers(2, 60, 2)
        folds[row : row + high, column : column + wide] *= random.uniform(0, 4)
    return np.asarray(folds / folds.mean())


def _card(walls: tuple[float, float], options: HallOptions, random: np.random.Generator) -> np.ndarray:
    """(4, 3) corners of an upright card before one of the four walls, its top about as high as theirs."""
    half_width, top = walls
    width = random.uniform(*options.card_m)
    height = width * random.uniform(0.6, 1)
    centre = random.uniform(-half_width, half_width)
    base = top - height * random.uniform(0.6, 1.1)
    along = centre + width * np.array([-0.5, 0.5, 0.5, -0.5])
    across = np.full(4, half_width - _BEFORE_WALL_M)
    upright = base + height * np.array([0, 0, 1, 1])
    angle = random.integers(4) * np.pi / 2
    x, y = np.cos(angle) * along - np.sin(angle) * across, np.sin(angle) * along + np.cos(angle) * across
    return np.stack([x, y, upright], axis=1)


def _within(corners: np.ndarray, share: float) -> np.ndarray:
    centre = corners.mean(axis=0)
    return np.asarray(centre + share * (corners - centre))


def _filled(pixels: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """(h, w) bool of a polygon (n, 2); nothing where a corner is behind the camera or far outside the picture."""
    import cv2

    filled = np.zeros(shape, np.uint8)
    if np.isfinite(pixels).all() and np.abs(pixels).max() < 10 * max(shape):
        cv2.fillConvexPoly(
            filled, np.rint((pixels - 0.5) * (1 << _FRACTION_BITS)).astype(np.int32), 1, shift=_FRACTION_BITS
        )
    return filled.astype(bool)


def _blob(shape: tuple[int, int], share: float, random: np.random.Generator) -> np.ndarray:
    """(h, w) Gaussian about a point anywhere in the picture, 1 in its centre."""
    height, width = shape
    sd = share * width
    across = np.exp(-0.5 * ((np.arange(width) - random.uniform(0, width)) / sd) ** 2)
    down = np.exp(-0.5 * ((np.arange(height) - random.uniform(0, height)) / sd) ** 2)
    return np.outer(down, across)
