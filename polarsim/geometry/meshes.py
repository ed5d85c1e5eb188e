"""Surfaces of triangles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.geometry.vectors import cross


@dataclass(frozen=True)
class Mesh:
    """Triangles: vertices (v, 3) in metres, faces (f, 3) vertex numbers, counter-clockwise seen from outside."""

    vertices: np.ndarray
    faces: np.ndarray

    def normals(self) -> np.ndarray:
        """(v, 3) unit vertex normals, weighted by area; zero where a vertex has no face."""
        a, b, c = (self.vertices[self.faces[:, k]] for k in range(3))
        face_normals = cross(b - a, c - a)
        corners = self.faces.T.ravel()
        sums = [np.bincount(corners, np.tile(part, 3), len(self.vertices)) for part in face_normals.T]
        normals = np.stack(sums, axis=1)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        return np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
