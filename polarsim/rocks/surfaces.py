"""Closed surfaces through clouds: screened Poisson reconstruction (Kazhdan and Hoppe, ACM ToG 32:29, 2013).

What no scanner saw of a rock, its back and its underside, is closed by points on the convex hull of what was seen.
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
from polarsim.geometry.topology import hull_faces, is_watertight
from polarsim.rocks.clouds import tangents
from polarsim.rocks.heights import FloorGrid, upward_normals
from polarsim.rocks.solids import compacted, largest_island, split_non_manifold

log = logging.getLogger("polarsim")

CELL_SHARES = (1.0, 0.97, 0.94)  # of the cell asked for, tried in turn: now and then a grid leaves a hole
DENSE_STEP = 0.35  # of the points' spacing
ROOM, GROUND_ROOM = 1.2, 1.02  # least side of the solver's cube over the cloud's; the ground's border is cut off
NO_AREA = 1e-12  # square metres of a parallelogram below which a face has no normal
MIN_DEPTH, MAX_DEPTH = 4, 11  # of the octree
SINK = 0.015  # metres that a rock's closed underside lies below the ground
UNSEEN_COSINE = 0.05  # a facet whose normal points away further than this from every scanner was not seen
GAP = 0.0075  # metres from the seen surface from which the unseen one begins
BARE = 0.03  # metres along a facet to the nearest seen point from which on nothing was seen below it, no hollow either
BULGE = 0.25  # rocks bulge beyond the hull of their seen side: metres outward per metre from what was seen


def closing_points(
    cloud: Cloud, grid: FloorGrid, ground: np.ndarray, bare: np.ndarray, scanners: np.ndarray, spacing: float
) -> Cloud:
    """Points that close a rock: on its back, at its foot and on a floor below the ground.

    The convex hull of the seen points and of their outline sunk below the ground has facets below the ground, and
    facets that face away from every scanner or that nothing was seen of; points on these close the rock, the latter
    ones bulging outward. Where bare ground was seen there is no rock, whatever its hull.

    Parameters
    ----------
    bare : (rows, columns) bool
        Cells of `grid` whose ground was seen.

    Raises
    ------
    ReconstructionError
        The points span no volume.
    """
    floor = _sunk(_outline(cloud.points), grid, ground)
    hull = hull_points(hull_mesh(np.concatenate([cloud.points, floor])), spacing)
    points, normals = hull.points, hull.normals
    above = points[:, 2] - grid.sample(ground, points)
    gap, nearest = KDTree(cloud.points).query(points)
    offset = cloud.points[nearest] - points
    beside = np.linalg.norm(offset - (offset * normals).sum(axis=1, keepdims=True) * normals, axis=1)
    to_scanners = scanners[None] - points[:, None]
    cosine = (to_scanners * normals[:, None]).sum(axis=-1) / np.linalg.norm(to_scanners, axis=-1)
    buried = above < -spacing  # ends below the ground: no plinth is seen
    facing_away = cosine.max(axis=1, initial=-1) < UNSEEN_COSINE
    back = (above >= -spacing) & (gap > GAP) & (facing_away | (beside > BARE))
    points = points + np.where(back, BULGE * np.minimum(gap, np.maximum(above, 0)), 0)[:, None] * normals
    kept = (buried | back) & ~bare.ravel()[np.maximum(grid.cell_of(points), 0)]
    return Cloud(points[kept], normals[kept])


def hull_mesh(points: np.ndarray) -> Mesh:
    """The convex hull of points (n, 3), faces outward.

    Raises
    ------
    ReconstructionError
        The points span no volume.
    """
    try:
        return compacted(points, hull_faces(points))
    except (QhullError, ValueError) as error:
        raise ReconstructionError(f"{len(points)} points span no volume") from error


def _outline(points: np.ndarray) -> np.ndarray:
    """(n, 2) corners of the plan's convex hull."""
    try:
        return points[ConvexHull(points[:, :2]).vertices, :2]
    except (QhullError, ValueError) as error:
        raise ReconstructionError(f"{len(points)} points lie on one line or are too few") from error


def _sunk(points: np.ndarray, grid: FloorGrid, ground: np.ndarray) -> np.ndarray:
    """(n, 3) points below (n, 2) ones of the ground."""
    return np.column_stack([points, grid.sample(ground, points) - SINK])


def hull_points(mesh: Mesh, spacing: float) -> Cloud:
    """Points about `spacing` apart on every face, with the faces' normals."""
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
    """(2, n) weights of two corners, at the middles of a triangle's cells where each side has so many."""
    u, v = (grid.ravel() + 1 / 3 for grid in np.meshgrid(np.arange(steps), np.arange(steps)))
    return np.stack([u, v])[:, u + v < steps] / steps


def poisson(cloud: Cloud, cell: float, room: float = ROOM) -> Mesh:
    """Poisson surface whose finest cells measure `cell` metres (larger ones at the octree's greatest depth).

    The cube is grown to a power of two of cells, so the surface is as fine as asked for and no finer. One thread: with
    more, the same cloud gives other meshes from run to run.
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
    """Keep the calling thread, and threads that it starts, on the core where it is.

    The solver starts a thread for every loop and waits for it. Woken on another core each time, it waits two thirds of
    its time, on one core not at all.
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
    """The Poisson surface through a ground without holes, cut at the grid's border.

    Parameters
    ----------
    heights : (rows, columns) float
        Heights on the grid, everywhere.
    cell : float
        Cell of the reconstruction, metres.
    """
    points = np.concatenate([grid.centres(), heights[..., None]], axis=-1).reshape(-1, 3)
    surface = poisson(Cloud(points, upward_normals(grid, heights).reshape(-1, 3)), cell, GROUND_ROOM)
    inside = grid.extent.contains(surface.vertices)
    return largest_island(compacted(surface.vertices, surface.faces[inside[surface.faces].all(axis=1)]))


def densified(cloud: Cloud) -> Cloud:
    """The cloud with points about each point on its tangent plane.

    Where cells hold few points the solver smooths over several of them, and a ball comes out too large: one of 80 mm
    by 0.8 mm with points 2.5 mm apart, by 0.03 mm with these.
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
    """A watertight rock: the seen surface, its unseen back and its underside below the ground closed smoothly.

    Parameters
    ----------
    cloud : Cloud
        The rock's seen surface, normals outward, metres.
    ground : (rows, columns) float
        Heights of the ground on `grid`, also under the rock.
    bare : (rows, columns) bool
        Cells whose ground was seen.
    scanners : (s, 3) float
        Where the scanners stood.
    cell : float
        Cell of the reconstruction, metres.

    Raises
    ------
    ReconstructionError
        The points span no volume.
    """
    closing = closing_points(cloud, grid, ground, bare, scanners, cell)
    seen = densified(cloud)
    whole = Cloud(np.concatenate([seen.points, closing.points]), np.concatenate([seen.normals, closing.normals]))
    closed = _closed(whole, cell)
    if closed is not None:
        return closed
    log.warning("no closed surface through %d points: their convex hull stands for the rock", len(cloud))
    hull = hull_mesh(whole.points)
    return _closed(hull_points(hull, cell), cell) or hull  # as fine as other rocks


def _closed(cloud: Cloud, cell: float) -> Mesh | None:
    """The largest part of the surface through a cloud, where some cell gives one without holes."""
    for share in CELL_SHARES:
        mesh = largest_island(split_non_manifold(poisson(cloud, share * cell)))
        if is_watertight(mesh.faces):
            return mesh
    return None
