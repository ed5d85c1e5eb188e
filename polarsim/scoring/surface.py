"""Triangle surfaces: sampling, closest points and visibility."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from polarsim.geometry.casters import make_caster
from polarsim.geometry.distance_scene import distance_scene
from polarsim.geometry.rays import Caster

_LIFT = 2e-3  # metres; offset of ray origins from the surface


class Surface:
    """Triangle surface of faces (f, 3) and vertices (v, 3), metres."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        self.vertices, self.faces = np.asarray(vertices, float), np.asarray(faces, np.int64)
        a, b, c = (self.vertices[self.faces[:, k]] for k in range(3))
        normals = np.cross(b - a, c - a)
        length = np.linalg.norm(normals, axis=1)
        self.area = length / 2  # (f,) m^2
        self.normals = np.divide(normals, length[:, None], out=np.zeros_like(normals), where=length[:, None] > 0)

    @cached_property
    def _scene(self) -> Any:
        return distance_scene(self.vertices, self.faces)

    @cached_property
    def _rays(self) -> Caster:
        return make_caster(self.vertices, self.faces)

    def sample(self, n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Return random points (n, 3), uniform by area, and the face (n,) of each point."""
        share = np.cumsum(self.area)
        face = np.searchsorted(share, rng.random(n) * share[-1], side="right").clip(max=len(self.faces) - 1)
        s, t = np.sqrt(rng.random(n)), rng.random(n)
        a, b, c = (self.vertices[self.faces[face, k]] for k in range(3))
        weights = np.stack([1 - s, s * (1 - t), s * t], axis=1)
        return weights[:, :1] * a + weights[:, 1:2] * b + weights[:, 2:] * c, face

    def nearest(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the nearest surface points (n, 3) of points (n, 3), and the faces (n,) of the surface points."""
        closest = self._scene.compute_closest_points(np.ascontiguousarray(points, np.float32))
        return closest["points"].numpy().astype(float), closest["primitive_ids"].numpy().astype(np.int64)

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return the distances (n,) of points (n, 3) to the surface, metres."""
        return np.linalg.norm(self.nearest(points)[0] - points, axis=1)

    def height_below(self, points: np.ndarray) -> np.ndarray:
        """Return the heights (n,) of points (n, 3) above the surface, metres; NaN outside the surface."""
        high = np.column_stack([points[:, :2], np.full(len(points), self.vertices[:, 2].max() + 1.0)])
        down = np.broadcast_to([0.0, 0.0, -1.0], high.shape)
        distance = self._rays.nearest(high, down)[0]
        return np.where(np.isfinite(distance), points[:, 2] - (high[:, 2] - distance), np.nan)

    def seen_from(self, eye: np.ndarray, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Return (n,) bool: surface points (n, 3) with normals (n, 3) that are visible from a point (3,)."""
        towards = eye - points
        facing = np.einsum("nk,nk->n", towards, normals) > 0
        starts = points + _LIFT * normals
        seen = np.zeros(len(points), bool)
        seen[facing] = ~self._rays.occluded(starts[facing], eye - starts[facing], 1.0)
        return seen
