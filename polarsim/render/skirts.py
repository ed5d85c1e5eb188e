"""Rocks sit in the sand: open rims of rock meshes are drawn out downwards, so that no light passes beneath them.

Scanned rocks have no underside, and their meshes end some millimetres above or below the ground's mesh.
"""

from __future__ import annotations

import numpy as np

from polarsim.formats.scene import TerrainMesh
from polarsim.geometry.topology import is_watertight

_LOWER_PART = 0.5  # of a rock's height: rims above it are holes in its back, not its foot
_SAME_PLACE = 1e-6  # metres: vertices nearer than this are one, or seams between them would count as rims


def with_skirts(mesh: TerrainMesh, depth: float) -> TerrainMesh:
    """The terrain with an upright skirt of `depth` metres under the low rims of every open rock."""
    vertices, faces, normals, rocks = [mesh.vertices], [mesh.faces], [mesh.normals], [mesh.rock_of_face]
    count = len(mesh.vertices)
    for rock in mesh.rocks:
        rim = low_rim(mesh.vertices, mesh.faces[mesh.rock_of_face == rock])
        if not len(rim):
            continue
        skirt, skirt_faces, skirt_normals = hang(mesh.vertices[rim[:, 0]], mesh.vertices[rim[:, 1]], depth)
        vertices.append(skirt)
        faces.append(skirt_faces + count)
        normals.append(skirt_normals)
        rocks.append(np.full(len(skirt_faces), rock))
        count += len(skirt)
    return TerrainMesh(*(np.concatenate(parts) for parts in (vertices, faces, rocks, normals)))


def low_rim(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(e, 2) vertex numbers of the edges that only one of the faces (f, 3) has, in its direction, low on the rock."""
    if is_watertight(faces):
        return np.zeros((0, 2), np.int64)
    used = np.unique(faces)
    place = _places(vertices[used])
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    start, end = place[np.searchsorted(used, edges)].T
    pair = np.minimum(start, end) * len(used) + np.maximum(start, end)
    _, first, times = np.unique(pair, return_index=True, return_counts=True)
    rim = edges[np.sort(first[times == 1])]
    height = vertices[used, 2]
    limit = height.min() + _LOWER_PART * np.ptp(height)
    return rim[(vertices[rim, 2] < limit).all(axis=1)]


def _places(vertices: np.ndarray) -> np.ndarray:
    """(v,) numbers below v that vertices (v, 3) share where they are in the same place."""
    rounded = np.round(vertices / _SAME_PLACE)
    order = np.lexsort(rounded.T)
    moved_on = (np.diff(rounded[order], axis=0) != 0).any(axis=1)
    place = np.empty(len(vertices), np.int64)
    place[order] = np.concatenate([[0], np.cumsum(moved_on)])
    return place


def hang(start: np.ndarray, end: np.ndarray, depth: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices (4 e, 3), faces (2 e, 3), normals (4 e, 3) of upright strips under edges from `start` to `end` (e, 3).

    They look to the side on which the faces above the edges look.
    """
    down = np.array([0, 0, depth])
    vertices = np.stack([start, end, end - down, start - down], axis=1)
    quads = np.arange(4 * len(start)).reshape(-1, 4)
    faces = np.concatenate([quads[:, [1, 0, 3]], quads[:, [1, 3, 2]]])
    along = end - start
    outward = np.stack([along[:, 1], -along[:, 0], np.zeros(len(along))], axis=1)
    length = np.linalg.norm(outward, axis=1, keepdims=True)
    outward = np.divide(outward, length, out=np.zeros_like(outward), where=length > 0)
    return vertices.reshape(-1, 3), faces, np.repeat(outward, 4, axis=0)
