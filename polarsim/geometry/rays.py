"""Intersection of rays and triangles: nearest hit of a ray, and occlusion between two points.

The NumPy engine in this module defines the result (Moeller and Trumbore, J. Graphics Tools 2 (1997) 21); both sides of
a triangle can be hit. `rays_embree` and `rays_taichi` must agree in float32. `casters.make_caster` selects the engine.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

NO_FACE = -1  # face number of a ray without a hit
START_OFFSET = 1e-4  # metres: `occluded` ignores nearer surfaces, so that no surface shades itself
_PAIRS = 1 << 20  # ray-triangle pairs per block: limits the memory of the NumPy engine to about 200 MB


@dataclass(frozen=True)
class RayHits:
    """Nearest hits: the m of n rays that hit a triangle."""

    ray: np.ndarray  # (m,) indices of the rays, ascending
    distance: np.ndarray  # (m,) in units of the direction's length
    face: np.ndarray  # (m,) int64
    weights: np.ndarray  # (m, 2) barycentric, of the triangle's second and third corner
    normal: np.ndarray  # (m, 3) of the flat triangle, of any length: (second - first) x (third - first)


class Caster(Protocol):
    """Triangles that can be hit by rays."""

    def nearest(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return distance (n,) and number (n,) int64 of the nearest triangle along rays (n, 3).

        The distance is in units of the direction's length, which is not zero: the point is origins + distance *
        directions. Rays without a hit have distance inf and `NO_FACE`.
        """
        ...

    def occluded(self, origins: np.ndarray, directions: np.ndarray, far: np.ndarray | float) -> np.ndarray:
        """Return (n,) whether a triangle is between `START_OFFSET` metres from the origin and `far` (n,) or scalar.

        `far` is in units of the direction's length: 1 if `directions` extend from the origin to the lamp.
        """
        ...


class Intersector(Caster, Protocol):
    """Caster that also computes the hit point on the triangle."""

    def intersect(self, origins: np.ndarray, directions: np.ndarray) -> RayHits:
        """Return the nearest hits with their points on the triangles."""
        ...


class CompositeScene:
    """Two sets of triangles cast as one scene, so that parts need not be built twice."""

    def __init__(self, first: Caster, second: Caster, first_faces: int) -> None:
        """`first_faces`: number of triangles of the first set, with which the numbers of the second set start."""
        self._first, self._second, self._first_faces = first, second, first_faces

    def nearest(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.nearer(*self._first.nearest(origins, directions), origins, directions)

    def nearer(
        self, distance: np.ndarray, face: np.ndarray, origins: np.ndarray, directions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return `nearest`, given `distance` and `face` (n,) of the first set."""
        other, other_face = self._second.nearest(origins, directions)
        nearer = np.flatnonzero(other < distance)
        distance, face = distance.copy(), face.copy()
        distance[nearer], face[nearer] = other[nearer], other_face[nearer] + self._first_faces
        return distance, face

    def occluded(self, origins: np.ndarray, directions: np.ndarray, far: np.ndarray | float) -> np.ndarray:
        hit = self._first.occluded(origins, directions, far)
        passed = np.flatnonzero(~hit)
        far = np.broadcast_to(np.asarray(far), len(origins))[passed]
        hit[passed] = self._second.occluded(origins[passed], directions[passed], far)
        return hit


class NumpyCaster:
    """Reference that tests every ray against every triangle, in double precision."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        corners = np.asarray(vertices, float)[np.asarray(faces, np.int64).reshape(-1, 3)]
        self._corner = corners[:, 0]
        self._edge1, self._edge2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]

    def nearest(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        origins, directions = np.asarray(origins, float), np.asarray(directions, float)
        distance = np.full(len(origins), np.inf)
        face = np.full(len(origins), NO_FACE, np.int64)
        for part in self._parts(len(origins)):
            distances = self._distances(origins[part], directions[part])
            best = distances.argmin(axis=1)
            distance[part] = distances[np.arange(len(distances)), best]
            face[part] = np.where(np.isfinite(distance[part]), best, NO_FACE)
        return distance, face

    def intersect(self, origins: np.ndarray, directions: np.ndarray) -> RayHits:
        distance, face = self.nearest(origins, directions)
        ray = np.flatnonzero(face >= 0)
        distance, face = distance[ray], face[ray]
        edge1, edge2 = self._edge1[face], self._edge2[face]
        normal = np.cross(edge1, edge2)
        area2 = np.einsum("nk,nk->n", normal, normal)
        point = np.asarray(origins, float)[ray] + distance[:, None] * np.asarray(directions, float)[ray]
        from_corner = point - self._corner[face]
        second = np.einsum("nk,nk->n", np.cross(from_corner, edge2), normal) / area2
        third = np.einsum("nk,nk->n", np.cross(edge1, from_corner), normal) / area2
        return RayHits(ray, distance, face, np.stack([second, third], axis=1), normal)

    def occluded(self, origins: np.ndarray, directions: np.ndarray, far: np.ndarray | float) -> np.ndarray:
        origins, directions = np.asarray(origins, float), np.asarray(directions, float)
        near = START_OFFSET / np.linalg.norm(directions, axis=1)
        far = np.broadcast_to(np.asarray(far, float), len(origins))
        hit = np.zeros(len(origins), bool)
        for part in self._parts(len(origins)):
            distances = self._distances(origins[part], directions[part])
            hit[part] = ((distances > near[part, None]) & (distances < far[part, None])).any(axis=1)
        return hit

    def _parts(self, rays: int) -> list[slice]:
        if not len(self._corner):
            return []
        step = max(1, _PAIRS // len(self._corner))
        return [slice(start, start + step) for start in range(0, rays, step)]

    def _distances(self, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Return the distance (n, f) of every ray to every triangle, inf without a hit."""
        p = np.cross(directions[:, None], self._edge2)
        determinant = np.einsum("nfk,fk->nf", p, self._edge1)
        from_corner = origins[:, None] - self._corner
        q = np.cross(from_corner, self._edge1)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = np.einsum("nfk,nfk->nf", from_corner, p) / determinant
            v = np.einsum("nfk,nk->nf", q, directions) / determinant
            t = np.einsum("nfk,fk->nf", q, self._edge2) / determinant
            inside = (u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0)  # False for NaN and inf of parallel rays
        return np.where(inside, t, np.inf)
