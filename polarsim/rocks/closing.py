"""What no scanner saw of a rock: its back and its underside, as points on the convex hull of what was seen."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, KDTree, QhullError

from polarsim.errors import ReconstructionError
from polarsim.formats.ply import Cloud
from polarsim.geometry.meshes import Mesh
from polarsim.rocks.heights import FloorGrid

SINK = 0.015  # metres that a rock's closed underside lies below the ground
UNSEEN_COSINE = 0.05  # a facet whose normal turns away further than this from every scanner was not seen
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
    turned_away = cosine.max(axis=1, initial=-1) < UNSEEN_COSINE
    back = (above >= -spacing) & (gap > GAP) & (turned_away | (beside > BARE))
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
        hull = ConvexHull(points)
    except (QhullError, ValueError) as error:
        raise ReconstructionError(f"{len(points)} points span no volume") from error
    faces = hull.simplices.copy()
    a, b, c = (points[faces[:, k]] for k in range(3))
    inward = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(axis=1) < 0
    faces[inward] = faces[inward][:, ::-1]
    used = np.unique(faces)
    return Mesh(points[used], np.searchsorted(used, faces))


def _outline(points: np.ndarray) -> np.ndarray:
    """(n, 2) corners of the plan's convex hull."""
    try:
        return points[ConvexHull(points[:, :2]).vertices, :2]
    except (QhullError, ValueError) as error:
        raise ReconstructionError(f"{len(points)} points lie on one line or are too few") from error


def _sunk(places: np.ndarray, grid: FloorGrid, ground: np.ndarray) -> np.ndarray:
    """(n, 3) places (n, 2) below the ground."""
    return np.column_stack([places, grid.sample(ground, places) - SINK])


def hull_points(mesh: Mesh, spacing: float) -> Cloud:
    """Points about `spacing` apart on every face, with the faces' normals."""
    points, normals = [], []
    for corners in mesh.vertices[mesh.faces]:
        a, b, c = corners
        normal = np.cross(b - a, c - a)
        length = np.linalg.norm(normal)
        if length < 1e-12:
            continue
        steps = max(1, int(np.ceil(max(np.linalg.norm(b - a), np.linalg.norm(c - a), np.linalg.norm(c - b)) / spacing)))
        u, v = (grid.ravel() + 1 / 3 for grid in np.meshgrid(np.arange(steps), np.arange(steps)))
        inside = u + v < steps
        u, v = u[inside, None] / steps, v[inside, None] / steps
        points.append(a + u * (b - a) + v * (c - a))
        normals.append(np.tile(normal / length, (len(u), 1)))
    return Cloud(np.concatenate(points), np.concatenate(normals))
