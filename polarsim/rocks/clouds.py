"""Clouds of single rocks: points of several scans merged in voxels, with normals, freed of the scanner's noise."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from polarsim.formats.ply import Cloud
from polarsim.rocks.scans import ScanPoints

NEIGHBOURS = 32  # points that tell a normal
NEIGHBOUR_SCALE = 0.005  # metres: Gaussian weight of neighbours; 2 mm noise of single points falls below 0.5 mm
NORMAL_SCALE = 0.35  # of |n_i - n_j|: across an edge of a rock neighbours do not count (bilateral weight)
PASSES = 2  # the second one knows normals, so it keeps edges


def voxel_means(scan: ScanPoints, voxel: float) -> ScanPoints:
    """One point per voxel (side in metres), weighted by range; in the order of voxels, whatever the points' order."""
    if not len(scan):
        return scan
    cells = np.floor(scan.points / voxel).astype(np.int64)
    cells -= cells.min(axis=0)
    spans = cells.max(axis=0) + 1
    number = (cells[:, 0] * spans[1] + cells[:, 1]) * spans[2] + cells[:, 2]
    order = np.lexsort((*scan.points.T, number))  # sums do not depend on the order of equal voxels' points
    starts = np.flatnonzero(np.diff(number[order], prepend=-1))
    weights = np.add.reduceat(scan.weights[order], starts)
    weighted = scan.weights[order][:, None]
    points = np.add.reduceat(scan.points[order] * weighted, starts, axis=0) / weights[:, None]
    to_scanner = np.add.reduceat(scan.to_scanner[order] * weighted, starts, axis=0)
    return ScanPoints(points, to_scanner / np.linalg.norm(to_scanner, axis=1, keepdims=True), weights)


def surface_cloud(scan: ScanPoints) -> Cloud:
    """Points moved on the local planes through their neighbours, with the planes' normals towards the scanner."""
    if len(scan) < 4:
        return Cloud(np.zeros((0, 3)), np.zeros((0, 3)))
    points, normals = scan.points, None
    for _ in range(PASSES):
        distance, near = KDTree(points).query(points, k=min(NEIGHBOURS, len(points)))
        weights = scan.weights[near] * np.exp(-0.5 * (distance / NEIGHBOUR_SCALE) ** 2)
        if normals is not None:
            unlike = np.linalg.norm(normals[near] - normals[:, None], axis=-1)
            weights *= np.exp(-0.5 * (unlike / NORMAL_SCALE) ** 2)
        weights /= weights.sum(axis=1, keepdims=True)
        centres = np.einsum("nk,nkc->nc", weights, points[near])
        offsets = points[near] - centres[:, None]
        covariance = np.einsum("nk,nkc,nkd->ncd", weights, offsets, offsets)
        normals = np.linalg.eigh(covariance)[1][:, :, 0]
        normals *= np.where((normals * scan.to_scanner).sum(axis=1, keepdims=True) < 0, -1.0, 1.0)
        points = points - ((points - centres) * normals).sum(axis=1, keepdims=True) * normals
    assert normals is not None
    return Cloud(points, normals)
