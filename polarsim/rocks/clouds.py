"""Clouds of single rocks: several aligned scans, merged in voxels and smoothed.

A single motion of a scan may not fit all rocks: scans are aligned again for each rock, by small translations.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations

import numpy as np
from scipy.spatial import KDTree

from polarsim.formats.ply import Cloud
from polarsim.rocks.scans import ScanPoints

NEIGHBOURS = 128  # points that determine the surface at a point
NEIGHBOUR_SCALE = 0.007  # metres: Gaussian weight of neighbours; reduces 2 mm noise of points below 0.3 mm
NORMAL_SCALE = 0.35  # of |n_i - n_j|: bilateral weight that excludes neighbours across an edge of a rock
PASSES = 2  # the second pass starts with better normals, so that it preserves edges
# Of slopes and second-order terms in neighbour scales: keeps a rim with neighbours on one side plane.
RIDGE = np.diag([0, 1e-6, 1e-6, 1e-3, 1e-3, 1e-3])
BLOCK = 4096  # points per block, to limit memory
MIN_SCAN_POINTS = 50  # minimum number of points of a thinned scan on a rock
ALIGNMENT_VOXEL = 0.006  # metres: grid of the thinned scans
PARTNER_DISTANCE = 0.009  # metres: maximum distance to a partner in the other scan
MIN_NORMAL_COSINE = 0.9  # minimum cosine between the normals of partners
WEIGHT_LIMITS = (0.004, 0.003, 0.002, 0.002)  # metres: distance from the plane with zero weight, one per round
SCAN_OFFSET_SD = 0.001  # metres: prior of the offset of a scan at a rock
LARGEST_SD = 0.0003  # maximum standard deviation of a translation in its least certain direction, metres
MIN_DETERMINED = 0.03  # minimum share of all pairs that determine the least certain direction: noise is not a slope
EXPLAINED = 0.5  # minimum share of the explained variance of the distances: shape alone can suggest a millimetre
_FREE = 3  # degrees of freedom of a common translation of all scans


def voxel_means(scan: ScanPoints, voxel: float) -> ScanPoints:
    """Return one point per voxel (side in metres), weighted by range, in the order of voxels."""
    if not len(scan):
        return scan
    cells = np.floor(scan.points / voxel).astype(np.int64)
    cells -= cells.min(axis=0)
    spans = cells.max(axis=0) + 1
    number = (cells[:, 0] * spans[1] + cells[:, 1]) * spans[2] + cells[:, 2]
    order = np.lexsort((*scan.points.T, number))  # makes sums independent of the order of points
    starts = np.flatnonzero(np.diff(number[order], prepend=-1))
    weights = np.add.reduceat(scan.weights[order], starts)
    weighted = scan.weights[order][:, None]
    points = np.add.reduceat(scan.points[order] * weighted, starts, axis=0) / weights[:, None]
    to_scanner = np.add.reduceat(scan.to_scanner[order] * weighted, starts, axis=0)
    return ScanPoints(points, to_scanner / np.linalg.norm(to_scanner, axis=1, keepdims=True), weights)


def surface_cloud(scan: ScanPoints) -> Cloud:
    """Project points onto quadrics through their neighbours, with the quadrics' normals towards the scanner.

    Moving least squares (Levin, 2003) of second order: planes would shrink a rock by the variance of the neighbours
    divided by its radius, which is half a millimetre for a radius of 50 mm.
    """
    if len(scan) < 4:
        return Cloud(np.zeros((0, 3)), np.zeros((0, 3)))
    distance, near = map(np.asarray, KDTree(scan.points).query(scan.points, k=min(NEIGHBOURS, len(scan))))
    weights = scan.weights[near] * np.exp(-0.5 * (distance / NEIGHBOUR_SCALE) ** 2)
    blocks = [slice(start, start + BLOCK) for start in range(0, len(scan), BLOCK)]
    normals = np.concatenate([_plane_normals(scan, near[rows], weights[rows], rows) for rows in blocks])
    points = scan.points
    for _ in range(PASSES):
        fits = [_on_quadrics(scan.points, normals, near[rows], weights[rows], rows) for rows in blocks]
        points, normals = (np.concatenate(parts) for parts in zip(*fits, strict=True))
    return Cloud(points, normals)


def _plane_normals(scan: ScanPoints, near: np.ndarray, weights: np.ndarray, rows: slice) -> np.ndarray:
    """Return normals (n, 3), towards the scanner, of the planes through neighbours (n, k) with weights (n, k)."""
    shares = weights / weights.sum(axis=1, keepdims=True)
    neighbours = scan.points.take(near, axis=0)
    offsets = neighbours - np.einsum("nk,nkc->nc", shares, neighbours)[:, None]
    covariance = (shares[..., None] * offsets).swapaxes(1, 2) @ offsets
    normals = np.linalg.eigh(covariance)[1][:, :, 0]
    away = (normals * scan.to_scanner[rows]).sum(axis=1, keepdims=True) < 0
    return np.where(away, -normals, normals)


def _on_quadrics(
    points: np.ndarray, normals: np.ndarray, near: np.ndarray, weights: np.ndarray, rows: slice
) -> tuple[np.ndarray, np.ndarray]:
    """Return points and normals (n, 3) on the height quadrics over the tangent planes of points."""
    normal = normals[rows]
    difference = np.linalg.norm(normals.take(near, axis=0) - normal[:, None], axis=-1)
    weights = weights * np.exp(-0.5 * (difference / NORMAL_SCALE) ** 2)
    weights = weights / weights.sum(axis=1, keepdims=True)
    across, along = tangents(normal)
    offsets = (points.take(near, axis=0) - points[rows, None]) / NEIGHBOUR_SCALE
    x, y, z = np.moveaxis(offsets @ np.stack([across, along, normal], axis=-1), -1, 0)
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)
    weighted = (terms * weights[..., None]).swapaxes(1, 2)
    normal_matrix = weighted @ terms + RIDGE
    heights = np.linalg.solve(normal_matrix, weighted @ z[..., None])[..., 0]
    tilted = normal - heights[:, [1]] * across - heights[:, [2]] * along
    return (
        points[rows] + NEIGHBOUR_SCALE * heights[:, [0]] * normal,
        tilted / np.linalg.norm(tilted, axis=1, keepdims=True),
    )


def tangents(normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return two arrays of unit vectors (n, 3), perpendicular to each other and to unit normals (n, 3)."""
    upright = np.abs(normals[:, [2]]) < 0.9
    across = np.cross(normals, np.where(upright, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]]))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return across, np.cross(normals, across)


def alignment_translations(scans: Sequence[ScanPoints]) -> np.ndarray | None:
    """Return translations (s, 3), metres, that align a rock's scans; zero if a translation does not improve them.

    Distances are measured between the smooth surfaces of scans, along normals. Therefore a rock needs faces towards
    three sides that two scans share; None if the points leave a direction undetermined. The weighted mean translation
    is zero, so that the rock keeps its position.

    `scans`: the points of each scan on the rock; scans with few points are not translated.
    """
    thinned = [voxel_means(scan, ALIGNMENT_VOXEL) for scan in scans]
    usable = [number for number, scan in enumerate(thinned) if len(scan) >= MIN_SCAN_POINTS]
    if len(usable) < 2:
        return None
    parts = [surface_cloud(thinned[number]) for number in usable]
    trees = [KDTree(part.points) for part in parts]
    moved: np.ndarray = np.zeros((len(usable), 3))
    variances = []
    for limit in WEIGHT_LIMITS:
        normal, right, variance = _equations(parts, trees, moved, limit)
        variances.append(variance)
        pairs, least_eigenvalue = np.trace(normal) / 2, np.linalg.eigvalsh(normal)[_FREE]
        if least_eigenvalue < MIN_DETERMINED * pairs or variance > LARGEST_SD**2 * least_eigenvalue:
            return None
        moved = np.linalg.solve(normal / variance + np.eye(len(normal)) / SCAN_OFFSET_SD**2, right / variance).reshape(
            -1, 3
        )
    translations = np.zeros((len(scans), 3))
    if _equations(parts, trees, moved, WEIGHT_LIMITS[0])[2] > (1 - EXPLAINED) * variances[0]:
        return translations
    weights = np.array([scans[number].weights.sum() for number in usable])
    translations[usable] = moved - weights @ moved / weights.sum()
    return np.round(translations, 7)  # removes the rounding errors of the solver


def _equations(
    parts: list[Cloud], trees: Sequence[KDTree], moved: np.ndarray, limit: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return normal matrix (3 s, 3 s) and right side of all translations, and the variance of all distances."""
    size = 3 * len(parts)
    normal, right, squares, total = np.zeros((size, size)), np.zeros(size), 0.0, 0.0
    for moving, fixed in permutations(range(len(parts)), 2):
        between = moved[moving] - moved[fixed]
        gap, nearest = trees[fixed].query(parts[moving].points + between, distance_upper_bound=PARTNER_DISTANCE)
        rows = np.flatnonzero(np.isfinite(gap))
        partner = np.asarray(nearest)[rows]
        direction = parts[fixed].normals[partner]
        facing = (parts[moving].normals[rows] * direction).sum(axis=1) > MIN_NORMAL_COSINE
        unmoved = ((parts[moving].points[rows] - parts[fixed].points[partner]) * direction).sum(axis=1)
        distance = unmoved + direction @ between
        weights = np.clip(1 - (distance / limit) ** 2, 0, 1) ** 2 * facing
        slopes = np.zeros((len(rows), size))
        slopes[:, 3 * moving : 3 * moving + 3] = direction
        slopes[:, 3 * fixed : 3 * fixed + 3] = -direction
        normal += (slopes * weights[:, None]).T @ slopes
        right -= slopes.T @ (weights * unmoved)
        squares, total = squares + float(weights @ distance**2), total + float(weights.sum())
    return normal, right, squares / max(total, 1.0) + 1e-12
