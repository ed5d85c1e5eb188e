"""Surfaces that are measured: points sampled on them, closest points, and number of islands."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from polarsim.geometry.casters import caster
from polarsim.geometry.rays import Caster

_LIFT = 2e-3  # metres: sampled points are looked at from here above their own surface


class Surface:
    """Triangles (f, 3) of vertices (v, 3), metres, that tell their closest points and what is seen from a point."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        self.vertices, self.faces = np.asarray(vertices, float), np.asarray(faces, np.int64)
        a, b, c = (self.vertices[self.faces[:, k]] for k in range(3))
        normals = np.cross(b - a, c - a)
        length = np.linalg.norm(normals, axis=1)
        self.area = length / 2  # (f,) m^2
        self.normals = np.divide(normals, length[:, None], out=np.zeros_like(normals), where=length[:, None] > 0)

    @cached_property
    def _scene(self) -> Any:
        import open3d as o3d

        scene = o3d.t.geometry.RaycastingScene(nthreads=1)
        scene.add_triangles(
            o3d.core.Tensor.from_numpy(np.ascontiguousarray(self.vertices, np.float32)),
            o3d.core.Tensor.from_numpy(np.ascontiguousarray(self.faces, np.uint32)),
        )
        return scene

    @cached_property
    def _rays(self) -> Caster:
        return caster(self.vertices, self.faces)

    def sample(self, n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Points (n, 3) spread evenly by area, and the face (n,) of each."""
        share = np.cumsum(self.area)
        face = np.searchsorted(share, rng.random(n) * share[-1], side="right").clip(max=len(self.faces) - 1)
        s, t = np.sqrt(rng.random(n)), rng.random(n)
        a, b, c = (self.vertices[self.faces[face, k]] for k in range(3))
        weights = np.stack([1 - s, s * (1 - t), s * t], axis=1)
        return weights[:, :1] * a + weights[:, 1:2] * b + weights[:, 2:] * c, face

    def nearest(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The nearest point (n, 3) on the surface to each point (n, 3), and the face (n,) that it lies on."""
        found = self._scene.compute_closest_points(np.ascontiguousarray(points, np.float32))
        return found["points"].numpy().astype(float), found["primitive_ids"].numpy().astype(np.int64)

    def distance(self, points: np.ndarray) -> np.ndarray:
        """(n,) metres from each point (n, 3) to the surface."""
        return np.linalg.norm(self.nearest(points)[0] - points, axis=1)

    def height_below(self, points: np.ndarray) -> np.ndarray:
        """(n,) how far points (n, 3) lie above the surface, metres, straight down or up; NaN beside it."""
        high = np.column_stack([points[:, :2], np.full(len(points), self.vertices[:, 2].max() + 1.0)])
        down = np.broadcast_to([0.0, 0.0, -1.0], high.shape)
        distance = self._rays.nearest(high, down)[0]
        return np.where(np.isfinite(distance), points[:, 2] - (high[:, 2] - distance), np.nan)

    def seen_from(self, eye: np.ndarray, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """(n,) bool: points on the surface, with their normals, that an eye (3,) can see."""
        towards = eye - points
        facing = np.einsum("nk,nk->n", towards, normals) > 0
        starts = points + _LIFT * normals
        seen = np.zeros(len(points), bool)
        seen[facing] = ~self._rays.occluded(starts[facing], eye - starts[facing], 1.0)
        return seen
