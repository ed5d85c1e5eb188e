"""Simple shading of a terrain's meshes in a view under one lamp at a time, for matching with photos.

Surfaces are matte, without texture and indirect light. The renderer is more accurate, but changes of the renderer must
not move cameras.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from polarsim.geometry.camera import Camera
from polarsim.geometry.casters import make_caster
from polarsim.geometry.rays import Caster
from polarsim.run_files.lamps import is_directional
from polarsim.run_files.scene import TerrainMesh


@dataclass(frozen=True)
class MeshSurface:
    """Triangles prepared for ray casts, with a normal for each."""

    rays: Caster
    normals: np.ndarray  # (f, 3) float32, means of the smooth normals of the corners


@dataclass(frozen=True)
class ViewHits:
    """Ray hits of the pixels of a view."""

    surface: MeshSurface
    points: np.ndarray  # (h, w, 3) float32, sandbox frame, metres; NaN for rays without a hit
    point: np.ndarray  # (n, 3) the points of the pixels with a hit
    normal: np.ndarray  # (n, 3) float32, towards the camera

    @property
    def hit(self) -> np.ndarray:
        """Mask (h, w) of pixels with a hit."""
        return np.isfinite(self.points[..., 0])

    @cached_property
    def _pixels(self) -> np.ndarray:
        """Numbers (n,) of the pixels with a hit."""
        return np.flatnonzero(self.hit)

    def shade(self, lamp: np.ndarray) -> np.ndarray:
        """Return the brightness (h, w) float32 under a lamp at (3,), sandbox frame, metres; zero in shadow.

        The brightness is the cosine of incidence, divided by the square of the distance unless the lamp is directional.
        """
        to_lamp = lamp.astype(np.float32) - self.point
        square = np.einsum("nk,nk->n", to_lamp, to_lamp)
        power = 0.5 if is_directional(lamp) else 1.5
        light = np.einsum("nk,nk->n", self.normal, to_lamp) / square**power
        lit = np.flatnonzero(light > 0)
        lit = lit[~self.surface.rays.occluded(self.point.take(lit, axis=0), to_lamp.take(lit, axis=0), 1.0)]
        image = np.zeros(self.points.shape[:2], np.float32)
        image.ravel()[self._pixels[lit]] = light[lit]
        return image


def surface_of(mesh: TerrainMesh) -> MeshSurface:
    return MeshSurface(make_caster(mesh.vertices, mesh.faces), mesh.normals[mesh.faces].mean(axis=1).astype(np.float32))


def cast_view(surface: MeshSurface, camera: Camera) -> ViewHits:
    """Cast a ray through every pixel of a view."""
    pixels = camera.pixel_directions().astype(np.float32)
    directions = pixels.reshape(-1, 3)
    distance, face = surface.rays.nearest(np.broadcast_to(camera.centre, directions.shape), directions)
    hit = np.flatnonzero(np.isfinite(distance))
    points = np.full(directions.shape, np.nan, np.float32)
    along = directions.take(hit, axis=0)
    points[hit] = camera.centre + distance[hit, None] * along
    normal = surface.normals.take(face[hit], axis=0)
    normal = normal * -np.sign(np.einsum("nk,nk->n", normal, along))[:, None]
    return ViewHits(surface, points.reshape(pixels.shape), points[hit], normal)
