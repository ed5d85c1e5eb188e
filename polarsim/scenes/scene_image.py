"""Image of a scene with labels, and the contrast of labelled objects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.photo import BLACK_LEVEL, ROCK, SHADOW, WHITE_LEVEL
from polarsim.render.ground_truth import boxes_of_ids
from polarsim.render.options import RenderOptions
from polarsim.run_files import class_masks
from polarsim.run_files.instances import ROCK_IDS, SHADOW_IDS
from polarsim.tone import encode_tone

_FIRST_ID = {ROCK: ROCK_IDS, SHADOW: SHADOW_IDS}  # of id maps, by kind; the number of a rock is added
Label = tuple[str, int, np.ndarray]  # kind, number of the rock, box (4,) x0, y0, x1, y1
_SEAM_PX = 2  # width of the seam around an object that is included in the contrast
_CROSS = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], np.uint8)  # 4-connectivity
_EXTREMES = (0.05, 0.95)  # quantiles of the grey values between which contrast is measured
_WHITE = 255  # maximum of 8-bit images


@dataclass(frozen=True)
class SceneImage:
    """Image of a scene under one lamp."""

    image: np.ndarray  # (h, w) uint8
    mask: np.ndarray  # (h, w) uint8 class mask, see `run_files.class_masks`
    labels: list[Label]  # boxes in pixels of the rendered size


def labels_with_contrast(
    ids: np.ndarray,
    radiance: np.ndarray,
    light: float,
    curve: np.ndarray,
    options: RenderOptions,
    min_contrast: float,
) -> tuple[list[Label], np.ndarray]:
    """Return the labels of objects with a minimum contrast, and the class mask (h, w) uint8 of these.

    Parameters
    ----------
    ids, radiance : (h, w)
        Id map, and radiance relative to bright ground.
    light
        DN above the black level of a radiance of 1.
    curve : (4096,) uint8
        See `tone_curve`.
    min_contrast
        See `object_contrast`.
    """
    labels = [
        (kind, rock, box)
        for kind, rock, box in boxes_of_ids(ids, options)
        if object_contrast(ids, _FIRST_ID[kind] + rock, box, radiance, light, curve) >= min_contrast
    ]
    return labels, class_masks.of_ids(ids, {_FIRST_ID[kind] + rock for kind, rock, _ in labels})


def object_contrast(
    ids: np.ndarray, number: int, box: np.ndarray, radiance: np.ndarray, light: float, curve: np.ndarray
) -> float:
    """Return the contrast of the object with an id `number` and a box (4,), and a seam around it, as a share of white.

    Contrast is the difference between the 5th and the 95th percentile of the grey values without noise. The seam is
    included because the outline of a dark rock in front of lit sand is visible.
    """
    import cv2

    left, top, right, bottom = (box + _SEAM_PX * np.array([-1, -1, 1, 1])).round().astype(int).tolist()
    window = (slice(max(top, 0), bottom), slice(max(left, 0), right))
    mask = cv2.dilate((ids[window] == number).astype(np.uint8), _CROSS, iterations=_SEAM_PX)
    values = np.sort(radiance[window][mask > 0])
    extremes = values[[round(share * (len(values) - 1)) for share in _EXTREMES]]
    low, high = curve[np.clip(BLACK_LEVEL + light * extremes, 0, WHITE_LEVEL).astype(int)]
    return float(int(high) - int(low)) / _WHITE


def tone_curve(gamma: float) -> np.ndarray:
    """Return the tone curve (4096,) uint8 from 12 to 8 bits with exponent 1 / gamma."""
    return encode_tone(np.arange(WHITE_LEVEL + 1) - BLACK_LEVEL, WHITE_LEVEL - BLACK_LEVEL, gamma)
