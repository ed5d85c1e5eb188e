"""Rays against triangles by Open3D's ray caster (Embree)."""

from __future__ import annotations

from typing import Any

import numpy as np

_PORTION = 200_000  # rays whose intersections are listed at a time


class Caster:
    """A scene of triangles: vertices (v, 3) and faces (f, 3)."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        import open3d as o3d

        self._tensor: Any = o3d.core.Tensor
        self._scene: Any = o3d.t.geometry.RaycastingScene()
        self._scene.add_triangles(self._as_tensor(vertices, np.float32), self._as_tensor(faces, np.uint32))

    def first_hits(self, rays: np.ndarray, threads: int) -> dict[str, np.ndarray]:
        """First hits of rays (..., 6): `t_hit` (inf for none), `primitive_ids`, `primitive_uvs` (..., 2)."""
        found = self._scene.cast_rays(self._as_tensor(rays, np.float32), nthreads=threads)
        return {name: found[name].numpy() for name in ("t_hit", "primitive_ids", "primitive_uvs")}

    def all_hits(self, rays: np.ndarray, threads: int) -> tuple[np.ndarray, np.ndarray]:
        """Every pair (ray, triangle) that meets before the ray's end, its direction's length; rays (n, 6)."""
        of_ray, of_face = [], []
        for low in range(0, len(rays), _PORTION):
            part = self._as_tensor(rays[low : low + _PORTION], np.float32)
            found = self._scene.list_intersections(part, nthreads=threads)
            before = found["t_hit"].numpy() < 1
            of_ray.append(found["ray_ids"].numpy()[before].astype(np.int64) + low)
            of_face.append(found["primitive_ids"].numpy()[before].astype(np.int64))
        return np.concatenate(of_ray), np.concatenate(of_face)

    def signed_distance(self, points: np.ndarray) -> np.ndarray:
        """(n,) distances of points (n, 3) from closed surfaces, negative inside."""
        return np.asarray(self._scene.compute_signed_distance(self._as_tensor(points, np.float32)).numpy())

    def _as_tensor(self, values: np.ndarray, dtype: type) -> Any:
        return self._tensor(np.ascontiguousarray(values, dtype))


def grid_faces(rows: int, columns: int) -> np.ndarray:
    """(f, 3) two triangles a cell of a grid whose vertices are numbered row by row."""
    k = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    return np.concatenate([np.stack([k, k + columns, k + 1], 1), np.stack([k + 1, k + columns, k + columns + 1], 1)])


def rays_from(origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """(..., 6) float32 rays from origins (broadcast) along directions (..., 3)."""
    return np.concatenate([np.broadcast_to(origins, directions.shape), directions], axis=-1).astype(np.float32)


def lengths(vectors: np.ndarray) -> np.ndarray:
    """(...) lengths of vectors (..., 3); three times as fast as NumPy's norm."""
    return np.sqrt(np.einsum("...k,...k->...", vectors, vectors))
