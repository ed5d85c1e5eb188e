"""Triangle meshes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from polarsim.geometry.vectors import cross

_ROUNDING = 0.75  # share of the way from a flat triangle to the tangent planes at its corners


@dataclass(frozen=True)
class Mesh:
    """Triangles: vertices (v, 3) in metres, faces (f, 3) vertex numbers, counter-clockwise seen from outside."""

    vertices: np.ndarray
    faces: np.ndarray

    def normals(self) -> np.ndarray:
        """Return unit vertex normals (v, 3), weighted by area; zero for vertices without a face."""
        a, b, c = (self.vertices[self.faces[:, k]] for k in range(3))
        face_normals = cross(b - a, c - a)
        corners = self.faces.T.ravel()
        sums = [np.bincount(corners, np.tile(part, 3), len(self.vertices)) for part in face_normals.T]
        normals = np.stack(sums, axis=1).astype(float)  # NumPy returns integers without faces
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        return np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)


def join_meshes(meshes: Sequence[Mesh]) -> Mesh:
    """Return a mesh of the triangles of one or more meshes, in their order."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]
    return Mesh(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces))


def subdivide_smoothly(mesh: Mesh) -> Mesh:
    """Divide every triangle into four: vertices are kept, edge midpoints are moved towards the tangent planes.

    Boubekeur and Alexa, Phong Tessellation, ACM TOG 27 (2008) 141.
    """
    corners = np.sort(mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, number = np.unique(corners, axis=0, return_inverse=True)
    ends, normals = mesh.vertices[edges], mesh.normals()[edges]
    middle = ends.mean(axis=1, keepdims=True)
    onto_planes = ((ends - middle) * normals).sum(axis=2, keepdims=True) * normals
    bulged = (middle + _ROUNDING * onto_planes.mean(axis=1, keepdims=True))[:, 0]
    a, b, c = mesh.faces.T
    ab, bc, ca = number.reshape(-1, 3).T + len(mesh.vertices)
    parts = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    faces = np.concatenate([np.stack(part, axis=1) for part in parts])
    return Mesh(np.concatenate([mesh.vertices, bulged]), faces)
