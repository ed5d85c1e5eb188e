"""Solid meshes: volume, manifold edges, and copies with fewer vertices."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from polarsim.geometry.meshes import Mesh
from polarsim.geometry.topology import (
    is_watertight,
    largest_island,
    linked_parts,
    numbered_edges,
    remove_unused_vertices,
)

COINCIDENT_ANGLE = 1e-6  # radians: coincident faces enclose an angle of zero, not a full turn
PARTING = 1e-5  # metres: displacement that separates touching parts of a surface


def merged_vertices(mesh: Mesh) -> Mesh:
    """Merge vertices at equal positions, and remove faces that become degenerate."""
    vertices, numbers = np.unique(mesh.vertices, axis=0, return_inverse=True)
    faces = numbers.reshape(-1)[mesh.faces]
    sound = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return remove_unused_vertices(vertices, faces[sound])


def volume(mesh: Mesh) -> float:
    """Signed volume, m^3: positive for a closed mesh with outward faces (divergence theorem)."""
    centre = mesh.vertices.mean(axis=0)
    a, b, c = (mesh.vertices[mesh.faces[:, k]] - centre for k in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


def decimate_mesh(mesh: Mesh, share: float) -> Mesh:
    """Reduce a mesh to about `share` of its vertices by quadric edge collapse; watertight if the mesh is.

    If a collapse folds the surface, a larger share is tried, and finally the mesh itself is returned.
    """
    source = _to_open3d(mesh)
    closed = is_watertight(mesh.faces)
    while share < 1:
        faces = max(12, round(share * len(mesh.faces)))
        fewer = source.simplify_quadric_decimation(faces)
        copy = split_non_manifold(_from_open3d(fewer))
        if len(copy.faces) and (is_watertight(copy.faces) or not closed):
            return largest_island(copy)
        share *= 1.25
    return mesh


def cluster_vertices(mesh: Mesh, max_vertices: int) -> Mesh:
    """Reduce a mesh to about `most` vertices for display, by clusters on a grid, if it has more."""
    if len(mesh.vertices) <= max_vertices:
        return mesh
    cell = np.sqrt(np.ptp(mesh.vertices[:, 0]) * np.ptp(mesh.vertices[:, 1]) / max_vertices)
    return _from_open3d(_to_open3d(mesh).simplify_vertex_clustering(cell))


def _to_open3d(mesh: Mesh) -> Any:
    import open3d

    return open3d.geometry.TriangleMesh(
        open3d.utility.Vector3dVector(mesh.vertices), open3d.utility.Vector3iVector(mesh.faces.astype(np.int32))
    )


def _from_open3d(mesh: Any) -> Mesh:
    """Convert a mesh, without vertices that no face uses."""
    return remove_unused_vertices(np.asarray(mesh.vertices), np.asarray(mesh.triangles).astype(np.int64))


def split_non_manifold(mesh: Mesh) -> Mesh:
    """Separate parts of a closed surface that touch along an edge or in a vertex, so that each edge has two faces.

    Octrees create edges of four faces where a surface touches itself. Such an edge is halved, and faces with solid
    between them are paired. Corners of faces that are connected by edges are the same vertex; vertices that are split
    into several are moved inwards.
    """
    edges, order, first, count = _group_edges(mesh.faces)
    if (count > 2).any():
        mesh = _halve_edges(mesh, np.sort(edges[order[first[count > 2]]], axis=1))
        edges, order, first, count = _group_edges(mesh.faces)
    starts, size = edges[:, 0], len(mesh.vertices)
    pairs = [np.stack([order[first[count == 2]], order[first[count == 2] + 1]], axis=1)]
    for at, number in zip(first[count > 2], count[count > 2], strict=True):
        pairs.append(_solid_pairs(mesh, order[at : at + number], edges))
    first_corner, second_corner = np.concatenate(pairs).T
    following = np.arange(len(starts)).reshape(-1, 3)[:, [1, 2, 0]].ravel()  # corner at the end of each edge
    links = np.concatenate(
        [
            np.stack([first_corner, following[second_corner]], axis=1),
            np.stack([following[first_corner], second_corner], axis=1),
        ]
    )
    vertex = linked_parts(links, len(starts))
    number = int(vertex.max(initial=-1)) + 1
    if number == len(np.unique(starts)):
        return mesh
    origin = np.empty(number, np.int64)
    origin[vertex] = starts
    apart = Mesh(mesh.vertices[origin], vertex.reshape(-1, 3).astype(np.int64))
    several = np.bincount(origin, minlength=size)[origin] > 1
    return Mesh(apart.vertices - np.where(several[:, None], PARTING * apart.normals(), 0.0), apart.faces)


def _group_edges(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return edges of all faces, their order by ends, the start of each edge in this order, and its number of faces.

    Row 3 f + k is edge k of face f.
    """
    edges, forward, backward = numbered_edges(faces)
    number = np.minimum(forward, backward)
    order = np.argsort(number, kind="stable")
    first = np.flatnonzero(np.diff(number[order], prepend=-1))
    return edges, order, first, np.diff(np.append(first, len(order)))


def _halve_edges(mesh: Mesh, edges: np.ndarray) -> Mesh:
    """Insert a vertex in the centre of given edges (n, 2), and cut their faces there."""
    centres = mesh.vertices[edges].mean(axis=1)
    centre = {(int(a), int(b)): len(mesh.vertices) + k for k, (a, b) in enumerate(edges)}

    def cut(face: tuple[int, int, int]) -> list[tuple[int, int, int]]:
        for a, b, c in (face, (face[1], face[2], face[0]), (face[2], face[0], face[1])):
            if (min(a, b), max(a, b)) in centre:
                half = centre[min(a, b), max(a, b)]
                return [*cut((a, half, c)), *cut((half, b, c))]
        return [face]

    touched = np.isin(mesh.faces, edges).sum(axis=1) >= 2
    parts = [part for a, b, c in mesh.faces[touched].tolist() for part in cut((a, b, c))]
    faces = np.concatenate([mesh.faces[~touched], np.array(parts, np.int64).reshape(-1, 3)])
    return Mesh(np.concatenate([mesh.vertices, centres]), faces)


def _solid_pairs(mesh: Mesh, rows: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Return pairs (n, 2) of the rows (2 n,) of `edges` on a line, with the least solid between their faces.

    Viewed along the line, solid is on one side of faces that run along it and on the opposite side of other faces.
    """
    low, high = np.sort(edges[rows[0]])
    line = mesh.vertices[high] - mesh.vertices[low]
    apex = mesh.vertices[mesh.faces[rows // 3, (rows + 2) % 3]] - mesh.vertices[low]
    across = np.cross(line, apex[0])
    along = np.cross(across, line)
    angle = np.arctan2(apex @ across * np.linalg.norm(line), apex @ along)
    forward = edges[rows, 0] == low
    solid = np.mod(angle[forward][:, None] - angle[~forward][None] + COINCIDENT_ANGLE, 2 * np.pi)
    along_it, against_it = linear_sum_assignment(np.sqrt(solid))  # of equal sums, the pairing with the thinnest part
    return np.stack([rows[forward][along_it], rows[~forward][against_it]], axis=1)
