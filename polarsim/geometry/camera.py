"""Camera: a lens at a pose, which maps between points of the world and pixels of a photo."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.geometry.boxes import box_around_points
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose


@dataclass(frozen=True)
class Camera:
    """Camera in the frame of the scene's points, such as the sandbox or the world of a rover."""

    world_from_camera: Pose
    lens: Lens

    @property
    def centre(self) -> np.ndarray:
        """Position (3,) in the world."""
        return self.world_from_camera.translation

    @property
    def size(self) -> np.ndarray:
        """Width and height (2,) of the photo, px."""
        return np.array([self.lens.width, self.lens.height])

    def project(self, points: np.ndarray) -> np.ndarray:
        """Return pixels (..., 2) of points (..., 3) in the world; NaN for points with negative depth."""
        return self.lens.project(self.world_from_camera.inverse().apply(points))

    def directions(self, pixels: np.ndarray) -> np.ndarray:
        """Return directions (..., 3) in the world through pixels (..., 2), with unit depth along the optical axis."""
        return self.world_from_camera.rotate(self.lens.directions(pixels))

    def pixel_directions(self) -> np.ndarray:
        """Return `directions` (h, w, 3) through the centres of all pixels."""
        return self.world_from_camera.rotate(self.lens.pixel_directions())

    def inside(self, pixels: np.ndarray) -> np.ndarray:
        """Return whether pixels (..., 2) are inside the photo; NaN is outside."""
        with np.errstate(invalid="ignore"):
            return np.all((pixels > 0) & (pixels < self.size), axis=-1)

    def box_around(self, points: np.ndarray) -> np.ndarray:
        """Return the box (4,) around points (n, 3), clipped at the image border; NaN if the photo shows none."""
        pixels = self.project(points)
        if not self.inside(pixels).any():
            return np.full(4, np.nan)
        return box_around_points(np.clip(pixels[np.isfinite(pixels).all(axis=1)], 0, self.size))

    def scaled(self, factor: float) -> Camera:
        """Return the camera with a photo that is `factor` times as large."""
        return Camera(self.world_from_camera, self.lens.scaled(factor))
