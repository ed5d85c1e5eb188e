"""Closed surfaces through clouds: screened Poisson reconstruction (Kazhdan and Hoppe, ACM ToG 32:29, 2013)."""

from __future__ import annotations

import logging

import numpy as np
from scipy.spatial import KDTree

from polarsim.formats.ply import Cloud
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.topology import is_watertight
from polarsim.rocks.closing import closing_points, hull_mesh, hull_points
from polarsim.rocks.clouds import tangents
from polarsim.rocks.heights import FloorGrid, upward_normals
from polarsim.rocks.non_manifold import split_non_manifold
from polarsim.rocks.solids import compacted, largest_island

log = logging.getLogger("polarsim")

CELL_SHARES = (1.0, 0.97, 0.94)  # of the cell asked for, tried in turn: now and then a grid leaves a hole
DENSE_STEP = 0.35  # of the points' spacing
ROOM, GROUND_ROOM = 1.2, 1.02  # least side of the solver's cube over the cloud's; the ground's border is cut off
MIN_DEPTH, MAX_DEPTH = 4, 11  # of the octree


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
    surface, _ = open3d.geometry.TriangleMesh.create_from_point_cloud_poisson(
        points, depth=depth, scale=max(room, cell * 2**depth / side), linear_fit=True, n_threads=1
    )
    return Mesh(np.asarray(surface.vertices).copy(), np.asarray(surface.triangles).astype(np.int64))


def ground_surface(grid: FloorGrid, heights: np.ndarray, cell: float) -> Mesh:
    """The Poisson surface through a ground without holes, cut at the grid's border.

    Parameters
    ----------
    heights : (rows, columns) float
        Heights on the grid, everywhere.
    cell : float
        Cell of the reconstruction, metres.
    """
    points = np.concatenate([grid.places(), heights[..., None]], axis=-1).reshape(-1, 3)
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
