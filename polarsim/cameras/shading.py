"""What a view shows of a terrain's meshes under one lamp at a time, plainly shaded: enough to find it again in photos.

Matte surfaces without texture or indirect light. The renderer does better, and may be edited without moving a camera.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from polarsim.formats.scene import TerrainMesh
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose
from polarsim.geometry.rays import Caster, caster


@dataclass(frozen=True)
class Surface:
    """Triangles ready for rays, with a normal for each."""

    rays: Caster
    normals: np.ndarray  # (f, 3) float32, the mean of the corners' smooth ones


@dataclass(frozen=True)
class Shaded:
    """A view: where its pixels' rays end, and how bright that is under each lamp."""

    points: np.ndarray  # (h, w, 3) float32, sandbox frame, metres; NaN where nothing is met
    images: dict[str, np.ndarray]  # lamp -> (h, w) float32, zero where no light falls

    @property
    def met(self) -> np.ndarray:
        """(h, w) bool: pixels whose rays meet a surface."""
        return np.isfinite(self.points[..., 0])


def surface_of(mesh: TerrainMesh) -> Surface:
    return Surface(caster(mesh.vertices, mesh.faces), mesh.normals[mesh.faces].mean(axis=1).astype(np.float32))


def shade(surface: Surface, sandbox_from_camera: Pose, lens: Lens, lamps: Mapping[str, np.ndarray]) -> Shaded:
    """Shade a view.

    Parameters
    ----------
    lamps : name -> (3,)
        Places of point lights, sandbox frame, metres.
    """
    size = (lens.height, lens.width)
    origin = sandbox_from_camera.translation
    directions = sandbox_from_camera.rotate(lens.pixel_directions()).reshape(-1, 3).astype(np.float32)
    distance, face = surface.rays.nearest(np.broadcast_to(origin, directions.shape), directions)
    met = np.flatnonzero(np.isfinite(distance))
    points = np.full(directions.shape, np.nan, np.float32)
    points[met] = origin + distance[met, None] * directions[met]
    place, normal = points[met], surface.normals[face[met]]
    normal = normal * -np.sign(np.einsum("nk,nk->n", normal, directions[met]))[:, None]  # to the side that is seen
    images = {}
    for name, lamp in lamps.items():
        to_lamp = lamp.astype(np.float32) - place
        square = np.einsum("nk,nk->n", to_lamp, to_lamp)
        light = np.einsum("nk,nk->n", normal, to_lamp) / square**1.5  # cosine over distance squared
        lit = np.flatnonzero(light > 0)
        lit = lit[~surface.rays.blocked(place[lit], to_lamp[lit], 1.0)]
        image = np.zeros(len(directions), np.float32)
        image[met[lit]] = light[lit]
        images[name] = image.reshape(size)
    return Shaded(points.reshape(*size, 3), images)
