"""What a view shows of a terrain's meshes under one lamp at a time, plainly shaded: enough to find it again in photos.

Matte surfaces without texture or indirect light. The renderer does better, and may be edited without moving a camera.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.geometry.camera import Camera
from polarsim.geometry.casters import caster
from polarsim.geometry.rays import Caster
from polarsim.run_files.scene import TerrainMesh


@dataclass(frozen=True)
class Surface:
    """Triangles ready for rays, with a normal for each."""

    rays: Caster
    normals: np.ndarray  # (f, 3) float32, the mean of the corners' smooth ones


@dataclass(frozen=True)
class Seen:
    """What the rays of a view's pixels meet."""

    surface: Surface
    points: np.ndarray  # (h, w, 3) float32, sandbox frame, metres; NaN where nothing is met
    point: np.ndarray  # (n, 3) the same of the pixels that meet something
    normal: np.ndarray  # (n, 3) float32, to the side that is seen

    @property
    def hit(self) -> np.ndarray:
        """(h, w) bool: pixels whose rays meet a surface."""
        return np.isfinite(self.points[..., 0])

    def under(self, lamp: np.ndarray) -> np.ndarray:
        """(h, w) float32 brightness under a point light at (3,), sandbox frame, metres; zero where no light falls."""
        to_lamp = lamp.astype(np.float32) - self.point
        square = np.einsum("nk,nk->n", to_lamp, to_lamp)
        light = np.einsum("nk,nk->n", self.normal, to_lamp) / square**1.5  # cosine over distance squared
        lit = np.flatnonzero(light > 0)
        lit = lit[~self.surface.rays.occluded(self.point[lit], to_lamp[lit], 1.0)]
        image = np.zeros(self.points.shape[:2], np.float32)
        image.ravel()[np.flatnonzero(self.hit)[lit]] = light[lit]
        return image


def surface_of(mesh: TerrainMesh) -> Surface:
    return Surface(caster(mesh.vertices, mesh.faces), mesh.normals[mesh.faces].mean(axis=1).astype(np.float32))


def look(surface: Surface, camera: Camera) -> Seen:
    """Cast a ray through every pixel of a view."""
    pixels = camera.pixel_directions().astype(np.float32)
    directions = pixels.reshape(-1, 3)
    distance, face = surface.rays.nearest(np.broadcast_to(camera.centre, directions.shape), directions)
    hit = np.flatnonzero(np.isfinite(distance))
    points = np.full(directions.shape, np.nan, np.float32)
    points[hit] = camera.centre + distance[hit, None] * directions[hit]
    normal = surface.normals[face[hit]]
    normal = normal * -np.sign(np.einsum("nk,nk->n", normal, directions[hit]))[:, None]
    return Seen(surface, points.reshape(pixels.shape), points[hit], normal)
