"""Closed surfaces through clouds: screened Poisson reconstruction (Kazhdan and Hoppe, ACM ToG 32:29, 2013)."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from polarsim.errors import ReconstructionError
from polarsim.formats.obj import Mesh
from polarsim.formats.ply import Cloud
from polarsim.rocks.heights import FloorGrid
from polarsim.rocks.solids import is_watertight, largest_island

SCALES = (1.3, 1.8)  # sides of the solver's cube over the cloud's; the second where a bulging back leaves the first
SINK = 0.015  # metres that a rock's closed underside lies below the ground
MIN_DEPTH, MAX_DEPTH = 4, 9  # of the octree


def poisson(cloud: Cloud, cell: float, scale: float) -> Mesh:
    """Poisson surface whose finest cells are at most `cell` metres (down to the octree's greatest depth).

    One thread: with more, the same cloud gives other meshes from run to run.
    """
    import open3d

    points = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(cloud.points))
    points.normals = open3d.utility.Vector3dVector(cloud.normals)
    side = np.ptp(cloud.points, axis=0).max() * scale
    depth = int(np.clip(np.ceil(np.log2(side / cell)), MIN_DEPTH, MAX_DEPTH))
    surface, _ = open3d.geometry.TriangleMesh.create_from_point_cloud_poisson(
        points, depth=depth, scale=scale, linear_fit=True, n_threads=1
    )
    return Mesh(np.asarray(surface.vertices).copy(), np.asarray(surface.triangles).astype(np.int64))


def closed_rock(cloud: Cloud, grid: FloorGrid, ground: np.ndarray, cell: float) -> Mesh:
    """A watertight rock: the seen surface, its unseen back closed smoothly, its underside below the ground.

    Parameters
    ----------
    cloud : Cloud
        The rock's seen surface, normals outward, metres.
    ground : (rows, columns) float
        Heights of the ground on `grid`, also under the rock.
    cell : float
        Largest cell of the reconstruction, metres.

    Raises
    ------
    ReconstructionError
        The points span no volume.
    """
    closing = underside(cloud, grid, ground, cell)
    whole = Cloud(np.concatenate([cloud.points, closing.points]), np.concatenate([cloud.normals, closing.normals]))
    for scale in SCALES:
        mesh = largest_island(poisson(whole, cell, scale))
        if is_watertight(mesh):
            return mesh
    return hull_mesh(whole.points)


def underside(cloud: Cloud, grid: FloorGrid, ground: np.ndarray, spacing: float) -> Cloud:
    """Points that close a rock below the ground: a floor parallel to it, and walls up to it around the plan's hull."""
    plan = cloud.points[:, :2]
    try:
        hull = ConvexHull(plan)
    except QhullError as error:
        raise ReconstructionError(f"{len(plan)} points in one line or fewer, a rock needs more") from error
    corners = plan[hull.vertices]  # counter-clockwise
    low, high = corners.min(axis=0), corners.max(axis=0)
    x, y = (np.arange(a, b + spacing, spacing) for a, b in zip(low, high, strict=True))
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    places = places[(places @ hull.equations[:, :2].T + hull.equations[:, 2] < -spacing / 2).all(axis=1)]
    floor = np.column_stack([places, grid.sample(ground, places) - SINK])
    edges, outward = _outline(corners, spacing)
    levels = np.arange(-SINK + spacing / 2, -spacing, spacing)  # ends below the ground: no plinth is seen
    walls = np.column_stack([np.repeat(edges, len(levels), axis=0), np.tile(levels, len(edges))])
    walls[:, 2] += np.repeat(grid.sample(ground, edges), len(levels))
    wall_normals = np.repeat(np.column_stack([outward, np.zeros(len(outward))]), len(levels), axis=0)
    floor_normals = np.tile([0.0, 0.0, -1.0], (len(floor), 1))
    return Cloud(np.concatenate([floor, walls]), np.concatenate([floor_normals, wall_normals]))


def _outline(corners: np.ndarray, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 2) along a closed convex polygon of counter-clockwise corners, and their outward normals (n, 2)."""
    points, normals = [], []
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        length = np.linalg.norm(end - start)
        steps = max(1, int(np.ceil(length / spacing)))
        points.append(start + (np.arange(steps)[:, None] + 0.5) / steps * (end - start))
        normals.append(np.tile(np.array([(end - start)[1], -(end - start)[0]]) / length, (steps, 1)))
    return np.concatenate(points), np.concatenate(normals)


def hull_mesh(points: np.ndarray) -> Mesh:
    """The convex hull of points (n, 3), outward oriented."""
    try:
        hull = ConvexHull(points)
    except QhullError as error:
        raise ReconstructionError(f"{len(points)} points span no volume") from error
    faces = hull.simplices.copy()
    a, b, c = (points[faces[:, k]] for k in range(3))
    inward = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(axis=1) < 0
    faces[inward] = faces[inward][:, ::-1]
    used = np.unique(faces)
    return Mesh(points[used], np.searchsorted(used, faces))
