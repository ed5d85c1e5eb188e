"""Ray casting for the analog: first hits and occlusion by Embree, signed distances by Open3D."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from polarsim.geometry.casters import make_caster
from polarsim.geometry.distance_scene import distance_scene
from polarsim.geometry.rays import Intersector

_PASS = 1e-5  # metres between a hit and the start of the search for the next hit of the same ray


@dataclass(frozen=True)
class FirstHits:
    """First hits of rays (...)."""

    distance: np.ndarray  # (...) float32, in units of the direction's length; inf: no hit
    face: np.ndarray  # (...) int32; 0 without a hit
    weights: np.ndarray  # (..., 2) float32 barycentric weights of the second and third corner

    @property
    def is_hit(self) -> np.ndarray:
        return np.isfinite(self.distance)


class RayCaster:
    """Ray caster of triangles: vertices (v, 3) and faces (f, 3). Results do not depend on the number of threads."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray, threads: int = 1) -> None:
        self._vertices, self._faces, self._threads = vertices, faces, threads

    def first_hits(self, origins: np.ndarray, directions: np.ndarray) -> FirstHits:
        """Return the first hits of rays along directions (..., 3) from origins (broadcast)."""
        shape = directions.shape[:-1]
        hits = self._caster.intersect(*_flat(origins, directions))
        distance = np.full(np.prod(shape, dtype=int), np.inf, np.float32)
        face = np.zeros(len(distance), np.int32)
        weights = np.zeros((len(distance), 2), np.float32)
        distance[hits.ray], face[hits.ray], weights[hits.ray] = hits.distance, hits.face, hits.weights
        return FirstHits(distance.reshape(shape), face.reshape(shape), weights.reshape(*shape, 2))

    def occluded(self, origins: np.ndarray, directions: np.ndarray, far: float = 1.0) -> np.ndarray:
        """Return (...) whether a triangle is between the origin and `far` times the direction, as `Caster.occluded`."""
        return self._caster.occluded(*_flat(origins, directions), far).reshape(directions.shape[:-1])

    def all_hits(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return ray and face of every hit along directions (n, 3), from origins (n, 3) to the direction's tip.

        Surfaces that are less than `_PASS` behind another surface are not hit.
        """
        rays, faces = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
        ray, passed = np.arange(len(origins)), np.zeros(len(origins))  # passed: share of the direction
        step = _PASS / np.linalg.norm(directions, axis=1)
        while len(ray):
            start = origins[ray] + passed[ray, None] * directions[ray]
            hits = self._caster.intersect(start, directions[ray])
            ray, at = ray[hits.ray], passed[ray[hits.ray]] + hits.distance
            before = at < 1
            ray = ray[before]
            rays.append(ray)
            faces.append(hits.face[before])
            passed[ray] = at[before] + step[ray]
        return np.concatenate(rays), np.concatenate(faces)

    def signed_distance(self, points: np.ndarray) -> np.ndarray:
        """Return the distances (n,) of points (n, 3) from closed surfaces, negative inside."""
        return np.asarray(self._distances.compute_signed_distance(np.ascontiguousarray(points, np.float32)).numpy())

    @cached_property
    def _caster(self) -> Intersector:
        return make_caster(self._vertices, self._faces, threads=self._threads)

    @cached_property
    def _distances(self) -> Any:
        return distance_scene(self._vertices, self._faces)


def _flat(origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return origins and directions (n, 3) of rays (..., 3); a common origin (3,) is repeated without a copy."""
    if origins.ndim > 1:
        origins = np.broadcast_to(origins, directions.shape).reshape(-1, 3)
    directions = directions.reshape(-1, 3)
    return np.broadcast_to(origins, directions.shape), directions


def grid_faces(rows: int, columns: int) -> np.ndarray:
    """Return faces (f, 3), two triangles per cell of a grid with vertices numbered row by row."""
    k = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    return np.concatenate([np.stack([k, k + columns, k + 1], 1), np.stack([k + 1, k + columns, k + columns + 1], 1)])


def lengths(vectors: np.ndarray) -> np.ndarray:
    """Return the lengths (...) of vectors (..., 3), three times as fast as NumPy's norm."""
    return np.sqrt(np.einsum("...k,...k->...", vectors, vectors))
