"""A lens at a pose: between points of the world and pixels of a photo."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.geometry.boxes import around
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose


@dataclass(frozen=True)
class Camera:
    """The world is the frame that the scene's points are in, such as the sandbox or what a rover drives over."""

    world_from_camera: Pose
    lens: Lens

    @property
    def centre(self) -> np.ndarray:
        """(3,) where it stands in the world."""
        return self.world_from_camera.translation

    @property
    def size(self) -> np.ndarray:
        """(2,) width and height of the photo, px."""
        return np.array([self.lens.width, self.lens.height])

    def project(self, points: np.ndarray) -> np.ndarray:
        """Pixels (..., 2) of points (..., 3) of the world; NaN behind the camera."""
        return self.lens.project(self.world_from_camera.inverse().apply(points))

    def directions(self, pixels: np.ndarray) -> np.ndarray:
        """Directions (..., 3) in the world through pixels (..., 2), of unit depth along the optical axis."""
        return self.world_from_camera.rotate(self.lens.directions(pixels))

    def pixel_directions(self) -> np.ndarray:
        """(h, w, 3) `directions` through the centres of all pixels."""
        return self.world_from_camera.rotate(self.lens.pixel_directions())

    def inside(self, pixels: np.ndarray) -> np.ndarray:
        """(...) bool: pixels (..., 2) of the photo; NaN is outside."""
        with np.errstate(invalid="ignore"):
            return np.all((pixels > 0) & (pixels < self.size), axis=-1)

    def box_around(self, points: np.ndarray) -> np.ndarray:
        """(4,) box around points (n, 3), cut at the photo's border; NaN where the photo shows none of them."""
        pixels = self.project(points)
        if not self.inside(pixels).any():
            return np.full(4, np.nan)
        return around(np.clip(pixels[np.isfinite(pixels).all(axis=1)], 0, self.size))

    def scaled(self, factor: float) -> Camera:
        """The same camera taking photos that are `factor` times as large."""
        return Camera(self.world_from_camera, self.lens.scaled(factor))
