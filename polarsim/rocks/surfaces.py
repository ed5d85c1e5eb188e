"""Closed surfaces through clouds: screened Poisson reconstruction (Kazhdan and Hoppe, ACM ToG 32:29, 2013).

The hidden back and the underside of a rock are closed by points on the convex hull of its scanned surface.
"""

from __future__ import annotations

import ctypes
import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from scipy.spatial import ConvexHull, KDTree, QhullError

from polarsim.errors import ReconstructionError
from polarsim.formats.ply import Cloud
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.topology import hull_faces, is_watertight, largest_island, remove_unused_vertices
from polarsim.rocks.clouds import tangents
from polarsim.rocks.heights import FloorGrid, upward_normals
from polarsim.rocks.solids import split_non_manifold

log = logging.getLogger("polarsim")

CELL_SHARES = (1.0, 0.97, 0.94, 0.8, 0.65)  # of the configured cell, tried in turn, because some grids leave a hole
DENSE_STEP = 0.35  # of the points' spacing
ROOM, GROUND_ROOM = 1.2, 1.02  # minimum side of the solver's cube over the cloud's; the ground's border is cut off
NO_AREA = 1e-12  # area of a parallelogram below which a face has no normal, square metres
MIN_DEPTH, MAX_DEPTH = 4, 11  # of the octree
UNDERSIDE_DEPTH = 0.015  # depth of a rock's closed underside below the ground, metres
UNSEEN_COSINE = 0.05  # minimum cosine between a facet's normal and a scanner for a visible facet
MIN_HIDDEN_GAP = 0.0075  # minimum distance of the hidden surface from the scanned surface, metres
MIN_HIDDEN_DISTANCE = 0.03  # minimum distance along a facet to the nearest scanned point for a hidden facet, metres
BULGE = 0.25  # outward bulge of the hidden surface beyond the hull, metres per metre from the scanned surface


def closing_points(
    cloud: Cloud, grid: FloorGrid, ground: np.ndarray, bare: np.ndarray, scanners: np.ndarray, spacing: float
) -> Cloud:
    """Return points that close a rock: on its back, at its foot and on a floor below the ground.

    The convex hull of the scanned points, and of their outline sunk below the ground, has facets below the ground, and
    facets that face away from every scanner or have no scanned points. Points on these facets close the rock, with an
    outward bulge on the hidden facets. There are no points above visible bare ground.

    `bare` (rows, columns): cells of `grid` with visible ground.
    """
    floor = _sink(_outline(cloud.points), grid, ground)
    hull = sample_hull(hull_mesh(np.concatenate([cloud.points, floor])), spacing)
    points, normals = hull.points, hull.normals
    above = points[:, 2] - grid.sample(ground, points)
    gap, nearest = KDTree(cloud.points).query(points)
    offset = cloud.points[nearest] - points
    distance_along_facet = np.linalg.norm(offset - (offset * normals).sum(axis=1, keepdims=True) * normals, axis=1)
    to_scanners = scanners[None] - points[:, None]
    cosine = (to_scanners * normals[:, None]).sum(axis=-1) / np.linalg.norm(to_scanners, axis=-1)
    buried = above < -spacing  # ends below the ground, so that no plinth is visible
    facing_away = cosine.max(axis=1, initial=-1) < UNSEEN_COSINE
    back = (above >= -spacing) & (gap > MIN_HIDDEN_GAP) & (facing_away | (distance_along_facet > MIN_HIDDEN_DISTANCE))
    points = points + np.where(back, BULGE * np.minimum(gap, np.maximum(above, 0)), 0)[:, None] * normals
    kept = (buried | back) & ~bare.ravel()[np.maximum(grid.cell_of(points), 0)]
    return Cloud(points[kept], normals[kept])


def hull_mesh(points: np.ndarray) -> Mesh:
    """Return the convex hull of points (n, 3), faces outward."""
    try:
        return remove_unused_vertices(points, hull_faces(points))
    except (QhullError, ValueError) as error:
        raise ReconstructionError(f"{len(points)} points enclose no volume") from error


def _outline(points: np.ndarray) -> np.ndarray:
    """Return the corners (n, 2) of the convex hull of the plan."""
    try:
        return points[ConvexHull(points[:, :2]).vertices, :2]
    except (QhullError, ValueError) as error:
        raise ReconstructionError(f"{len(points)} points are collinear or too few") from error


def _sink(points: np.ndarray, grid: FloorGrid, ground: np.ndarray) -> np.ndarray:
    """Return points (n, 3) below the ground at points (n, 2)."""
    return np.column_stack([points, grid.sample(ground, points) - UNDERSIDE_DEPTH])


def sample_hull(mesh: Mesh, spacing: float) -> Cloud:
    """Return points with a spacing of about `spacing` on every face, with the faces' normals."""
    corners = mesh.vertices[mesh.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(across, axis=1)
    kept = length >= NO_AREA
    a, normals = corners[kept, 0], across[kept] / length[kept, None]
    b, c = corners[kept, 1] - a, corners[kept, 2] - a
    longest = np.max([np.linalg.norm(side, axis=1) for side in (b, c, c - b)], axis=0)
    steps = np.maximum(1, np.ceil(longest / spacing)).astype(int).tolist()
    grids = {count: _barycentric(count) for count in set(steps)}
    u, v = np.concatenate([grids[count] for count in steps], axis=1)[..., None]
    face = np.repeat(np.arange(len(steps)), [grids[count].shape[1] for count in steps])
    return Cloud(a[face] + u * b[face] + v * c[face], normals[face])


def _barycentric(steps: int) -> np.ndarray:
    """Return weights (2, n) of two corners at the centres of a triangle's cells, with `steps` cells along each side."""
    u, v = (grid.ravel() + 1 / 3 for grid in np.meshgrid(np.arange(steps), np.arange(steps)))
    return np.stack([u, v])[:, u + v < steps] / steps


def poisson(cloud: Cloud, cell: float, room: float = ROOM) -> Mesh:
    """Return the Poisson surface with a finest cell of `cell` metres (larger at the octree's maximum depth).

    The cube is enlarged to a power of two of cells, so that the resolution is exactly `cell`. The solver uses a single
    thread, because several threads give different meshes from run to run.
    """
    import open3d

    points = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(cloud.points))
    points.normals = open3d.utility.Vector3dVector(cloud.normals)
    side = np.ptp(cloud.points, axis=0).max()
    depth = int(np.clip(np.ceil(np.log2(room * side / cell)), MIN_DEPTH, MAX_DEPTH))
    with _one_core():
        surface, _ = open3d.geometry.TriangleMesh.create_from_point_cloud_poisson(
            points, depth=depth, scale=max(room, cell * 2**depth / side), linear_fit=True, n_threads=1
        )
    return Mesh(np.asarray(surface.vertices).copy(), np.asarray(surface.triangles).astype(np.int64))


@contextmanager
def _one_core() -> Iterator[None]:
    """Pin the calling thread, and threads that it starts, to the current core.

    The solver starts a thread for every loop and waits for it. If the thread starts on another core, waiting takes two
    thirds of the time.
    """
    if not hasattr(os, "sched_setaffinity"):  # macOS, Windows
        yield
        return
    allowed = os.sched_getaffinity(0)
    here = ctypes.CDLL(None).sched_getcpu()
    os.sched_setaffinity(0, {here} & allowed or allowed)
    try:
        yield
    finally:
        os.sched_setaffinity(0, allowed)


def ground_surface(grid: FloorGrid, heights: np.ndarray, cell: float) -> Mesh:
    """Return the Poisson surface, cells of `cell` metres, through heights (rows, columns), cut at the border."""
    points = np.concatenate([grid.centres(), heights[..., None]], axis=-1).reshape(-1, 3)
    surface = poisson(Cloud(points, upward_normals(heights, grid.cell).reshape(-1, 3)), cell, GROUND_ROOM)
    inside = grid.extent.contains(surface.vertices)
    return largest_island(remove_unused_vertices(surface.vertices, surface.faces[inside[surface.faces].all(axis=1)]))


def densified(cloud: Cloud) -> Cloud:
    """Add points around each point on its tangent plane.

    In cells with few points the solver smooths over several cells, and a ball becomes too large: a ball of 80 mm by
    0.8 mm with points 2.5 mm apart, by 0.03 mm with the additional points.
    """
    if len(cloud) < 2:
        return cloud
    spacing = float(np.median(np.asarray(KDTree(cloud.points).query(cloud.points, k=2)[0])[:, 1]))
    across, along = tangents(cloud.normals)
    steps = DENSE_STEP * spacing * np.stack([across, -across, along, -along])
    points = np.concatenate([cloud.points, (cloud.points + steps).reshape(-1, 3)])
    return Cloud(points, np.tile(cloud.normals, (len(steps) + 1, 1)))


def closed_rock(
    cloud: Cloud, grid: FloorGrid, ground: np.ndarray, bare: np.ndarray, scanners: np.ndarray, cell: float
) -> Mesh:
    """Return a watertight rock: scanned surface, hidden back, and underside below the ground, closed smoothly.

    `ground` (rows, columns): heights of the ground on `grid`, also under the rock.
    `bare` (rows, columns): cells with visible ground.
    """
    closing = closing_points(cloud, grid, ground, bare, scanners, cell)
    scanned = densified(cloud)
    complete = Cloud(
        np.concatenate([scanned.points, closing.points]), np.concatenate([scanned.normals, closing.normals])
    )
    closed = _close(complete, cell)
    if closed is not None:
        return closed
    log.warning("no closed surface through %d points: their convex hull is used instead", len(cloud))
    hull = hull_mesh(complete.points)
    return _close(sample_hull(hull, cell), cell) or hull  # as fine as the meshes of other rocks


def _close(cloud: Cloud, cell: float) -> Mesh | None:
    """Return the largest part of the surface through a cloud, with the first cell without holes; None without any."""
    for share in CELL_SHARES:
        mesh = largest_island(split_non_manifold(poisson(cloud, share * cell)))
        if is_watertight(mesh.faces):
            return mesh
    return None
