"""Topology of triangles: connected parts, closedness and edges, from vertex numbers only."""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull

from polarsim.geometry.meshes import Mesh


def hull_faces(points: np.ndarray) -> np.ndarray:
    """Return the faces (f, 3) of the convex hull of points (n, 3), oriented outwards; QhullError without volume."""
    hull = ConvexHull(points)
    faces = hull.simplices.copy()
    a, b, c = (points[faces[:, k]] for k in range(3))
    inward = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(axis=1) < 0
    faces[inward] = faces[inward][:, ::-1]
    return faces


def linked_parts(links: np.ndarray, size: int) -> np.ndarray:
    """Return the number (size,) of the connected part of each element, by pairs (n, 2) of linked elements."""
    graph = coo_array((np.ones(len(links), bool), (links[:, 0], links[:, 1])), shape=(size, size))
    return np.asarray(connected_components(graph, directed=False)[1])


def part_of_vertex(faces: np.ndarray, vertices: int) -> np.ndarray:
    """Return the number (vertices,) of the connected part of each vertex; parts of faces (f, 3) share no vertex.

    A vertex that no face uses is a separate part.
    """
    return linked_parts(np.concatenate([faces[:, :2], faces[:, 1:]]), vertices)


def part_of_face(faces: np.ndarray) -> np.ndarray:
    """Return the number (f,), from 0, of the connected part of each face (f, 3); parts share no vertex."""
    if not len(faces):
        return np.zeros(0, int)
    part = part_of_vertex(faces, int(faces.max()) + 1)
    return np.unique(part[faces[:, 0]], return_inverse=True)[1]


def remove_unused_vertices(vertices: np.ndarray, faces: np.ndarray) -> Mesh:
    """Remove vertices that no face uses."""
    used, numbers = np.unique(faces, return_inverse=True)
    return Mesh(vertices[used], numbers.reshape(-1, 3))


def largest_island(mesh: Mesh) -> Mesh:
    """Return the connected part with the largest number of faces, without unused vertices."""
    part = part_of_face(mesh.faces)
    if not len(part):
        return mesh
    return remove_unused_vertices(mesh.vertices, mesh.faces[part == np.argmax(np.bincount(part))])


def is_watertight(faces: np.ndarray) -> bool:
    """Return whether every edge belongs to two of the faces (f, 3), once in each direction; False without faces."""
    if not len(faces):
        return False
    _, forward, backward = numbered_edges(faces)
    forward.sort()
    backward.sort()
    return bool((np.diff(forward) > 0).all()) and np.array_equal(forward, backward)


def open_edges(faces: np.ndarray) -> np.ndarray:
    """Return the edges (e, 2) of faces (f, 3), in their direction, without an opposite edge: rims and holes."""
    edges, forward, backward = numbered_edges(faces)
    return edges[~pd.Index(forward).isin(backward)]  # by hashes; NumPy sorts, which is 20 times slower


def numbered_edges(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return edges (3 f, 2) of faces (f, 3) in their direction, their numbers, and numbers of opposite edges."""
    edges = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).astype(np.int64)
    size = edges.max(initial=0) + 1
    return edges, edges[:, 0] * size + edges[:, 1], edges[:, 1] * size + edges[:, 0]
