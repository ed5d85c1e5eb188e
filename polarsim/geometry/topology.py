"""How triangles hang together: connected parts and closedness, from vertex numbers alone."""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull


def hull_faces(points: np.ndarray) -> np.ndarray:
    """(f, 3) faces of the convex hull of points (n, 3), which look outwards.

    Raises
    ------
    QhullError
        They span no volume.
    ValueError
        They are too few, or not finite.
    """
    hull = ConvexHull(points)
    faces = hull.simplices.copy()
    a, b, c = (points[faces[:, k]] for k in range(3))
    inward = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(axis=1) < 0
    faces[inward] = faces[inward][:, ::-1]
    return faces


def part_of_vertex(faces: np.ndarray, vertices: int) -> np.ndarray:
    """(vertices,) number of the connected part of each vertex; parts of faces (f, 3) share no vertex.

    A vertex that no face uses is a part of its own.
    """
    first, second = faces[:, [0, 1]].ravel(), faces[:, [1, 2]].ravel()
    links = coo_array((np.ones(len(first), bool), (first, second)), shape=(vertices, vertices))
    return np.asarray(connected_components(links, directed=False)[1])


def part_of_face(faces: np.ndarray) -> np.ndarray:
    """(f,) number, from 0 on, of the connected part of each of the faces (f, 3); parts share no vertex."""
    if not len(faces):
        return np.zeros(0, int)
    part = part_of_vertex(faces, int(faces.max()) + 1)
    return np.unique(part[faces[:, 0]], return_inverse=True)[1]


def is_watertight(faces: np.ndarray) -> bool:
    """Whether every edge belongs to two of the faces (f, 3), once in each direction; no face closes nothing."""
    if not len(faces):
        return False
    _, forward, backward = numbered_edges(faces)
    forward.sort()
    backward.sort()
    return bool((np.diff(forward) > 0).all()) and np.array_equal(forward, backward)


def open_edges(faces: np.ndarray) -> np.ndarray:
    """(e, 2) edges of faces (f, 3), in their direction, that no face runs along the other way: rims and holes."""
    edges, forward, backward = numbered_edges(faces)
    return edges[~pd.Index(forward).isin(backward)]  # by hashes: NumPy sorts, which takes 20 times as long


def numbered_edges(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Edges (3 f, 2) of faces (f, 3) in their direction, face by face; a number for each, and that of the way back."""
    edges = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).astype(np.int64)
    size = edges.max(initial=0) + 1
    return edges, edges[:, 0] * size + edges[:, 1], edges[:, 1] * size + edges[:, 0]
