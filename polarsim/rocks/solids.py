"""What makes a mesh a solid: islands, volume; and copies with fewer vertices."""

from __future__ import annotations

from typing import Any

import numpy as np

from polarsim.geometry.meshes import Mesh
from polarsim.geometry.topology import is_watertight, part_of_vertex
from polarsim.rocks.non_manifold import split_non_manifold


def compacted(vertices: np.ndarray, faces: np.ndarray) -> Mesh:
    """The mesh without vertices that no face uses."""
    used, numbers = np.unique(faces, return_inverse=True)
    return Mesh(vertices[used], numbers.reshape(-1, 3))


def merged_vertices(mesh: Mesh) -> Mesh:
    """Vertices at one place become one; faces that lose a corner by it go."""
    vertices, numbers = np.unique(mesh.vertices, axis=0, return_inverse=True)
    faces = numbers.reshape(-1)[mesh.faces]
    sound = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return compacted(vertices, faces[sound])


def islands(mesh: Mesh) -> np.ndarray:
    """(f,) number of the connected part that a face belongs to; parts share no vertex."""
    if not len(mesh.faces):
        return np.zeros(0, int)
    part = part_of_vertex(mesh.faces, len(mesh.vertices))
    return np.unique(part[mesh.faces[:, 0]], return_inverse=True)[1]


def largest_island(mesh: Mesh) -> Mesh:
    """The connected part with most faces."""
    part = islands(mesh)
    if not len(part):
        return mesh
    return compacted(mesh.vertices, mesh.faces[part == np.argmax(np.bincount(part))])


def volume(mesh: Mesh) -> float:
    """Signed volume, m^3: positive for a closed mesh with outward faces (divergence theorem)."""
    centre = mesh.vertices.mean(axis=0)
    a, b, c = (mesh.vertices[mesh.faces[:, k]] - centre for k in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


def decimated(mesh: Mesh, share: float) -> Mesh:
    """About `share` of the vertices, by quadric edge collapse; watertight where the mesh was.

    Raising the share finds a sound copy where a collapse folded the surface; the mesh itself is one at last.
    """
    source = _in_open3d(mesh)
    closed = is_watertight(mesh.faces)
    while share < 1:
        faces = max(12, round(share * len(mesh.faces)))
        fewer = source.simplify_quadric_decimation(faces)
        copy = split_non_manifold(_from_open3d(fewer))
        if len(copy.faces) and (is_watertight(copy.faces) or not closed):
            return largest_island(copy)
        share *= 1.25
    return mesh


def thinned(mesh: Mesh, most: int) -> Mesh:
    """About `most` vertices for looking at, by clusters on a grid; the mesh itself where it has no more."""
    if len(mesh.vertices) <= most:
        return mesh
    cell = np.sqrt(np.ptp(mesh.vertices[:, 0]) * np.ptp(mesh.vertices[:, 1]) / most)
    return _from_open3d(_in_open3d(mesh).simplify_vertex_clustering(cell))


def _in_open3d(mesh: Mesh) -> Any:
    import open3d

    return open3d.geometry.TriangleMesh(
        open3d.utility.Vector3dVector(mesh.vertices), open3d.utility.Vector3iVector(mesh.faces.astype(np.int32))
    )


def _from_open3d(mesh: Any) -> Mesh:
    """The mesh without vertices that no face uses."""
    return compacted(np.asarray(mesh.vertices), np.asarray(mesh.triangles).astype(np.int64))
