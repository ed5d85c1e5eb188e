"""Height maps of the ground with their uncertainty and origin, and the photos from which they are refined."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.geometry.camera import Camera
from polarsim.photo import PhotoKey
from polarsim.rocks.heights import FloorGrid

INVENTED, INFERRED, MEASURED = 0, 1, 2  # kinds of cells: interpolated; from shading; from scan, stereo, sweep or foot


@dataclass(frozen=True)
class HeightMap:
    """Heights of the ground on a grid; arrays are (rows along y, columns along x)."""

    grid: FloorGrid
    height_m: np.ndarray  # z of the cells' centres, sandbox frame
    sd_m: np.ndarray  # standard deviation, metres; inf where nothing is known
    kind: np.ndarray  # uint8: INVENTED, INFERRED or MEASURED


@dataclass(frozen=True)
class PhotoView:
    """Photo of the ground from a known pose under a known Sun lamp."""

    key: PhotoKey
    picture: np.ndarray  # (h, w) float32, linear in radiance or grey values of a published cover; NaN where masked
    camera: Camera
    lamp_m: np.ndarray  # (3,) position of the Sun lamp, sandbox frame
    linear: bool  # whether the picture is linear in radiance; False: unknown tone curve
