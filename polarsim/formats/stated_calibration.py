"""Contents of a calibration file, before they are compared with a site."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class StatedLens:
    """Camera matrix (3, 3) in OpenCV's pixels, distortion k1 k2 p1 p2 k3 ..., names in the file, and image size."""

    matrix: np.ndarray
    distortion: np.ndarray
    name: str
    distortion_name: str
    size: tuple[int, int] | None = None


@dataclass(frozen=True)
class StatedCalibration:
    """One lens, or two lenses with x_right = rotation x_left + translation, metres."""

    left: StatedLens
    right: StatedLens | None = None
    rotation: np.ndarray | None = None
    translation: np.ndarray | None = None
    translation_name: str = ""  # in the file
