"""Clouds of single rocks: several scans laid on each other, merged in voxels, freed of the scanner's noise.

One motion of a scan may not fit all rocks: scans settle on each other once more rock by rock, by small translations.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations

import numpy as np
from scipy.spatial import KDTree

from polarsim.formats.ply import Cloud
from polarsim.rocks.scans import ScanPoints

NEIGHBOURS = 128  # points that tell the surface about one
NEIGHBOUR_SCALE = 0.007  # metres: Gaussian weight of neighbours; 2 mm noise of single points falls below 0.3 mm
NORMAL_SCALE = 0.35  # of |n_i - n_j|: across an edge of a rock neighbours do not count (bilateral weight)
PASSES = 2  # the second one knows better normals, so it keeps edges
# On slopes and second-order terms in neighbour scales: a rim with neighbours on one side stays plane, a lone point put.
RIDGE = np.diag([0, 1e-6, 1e-6, 1e-3, 1e-3, 1e-3])
BLOCK = 4096  # points that are worked on at once: memory stays small
LEAST_POINTS = 50  # of a thinned scan on a rock: fewer tell nothing
VOXEL = 0.006  # metres to which scans are thinned
REACH = 0.009  # metres to a partner on the other scan
ALIKE = 0.9  # least cosine between partners' normals
LIMITS = (0.004, 0.003, 0.002, 0.002)  # metres from the partner's plane from which points have no say, one a round
TRANSLATION_SD = 0.001  # metres: how far a scan may lie off at a rock
LARGEST_SD = 0.0003  # metres: standard deviation of a translation, where points tell it least, that still is believed
LEAST_TOLD = 0.03  # of all pairs that must tell the direction told least: noise of normals is no slope
EXPLAINED = 0.5  # share of the distances' variance that must go: shape alone feigns a millimetre
_FREE = 3  # directions along which all scans together may move


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
    """Points moved on the quadrics through their neighbours, with the quadrics' normals towards the scanner.

    Moving least squares (Levin, 2003) of second order: planes would shrink a rock by the neighbours' variance over its
    radius, half a millimetre where that is 50 mm.
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
    """(n, 3) normals, towards the scanner, of the planes through neighbours (n, k) with weights (n, k)."""
    shares = weights / weights.sum(axis=1, keepdims=True)
    neighbours = scan.points[near]
    offsets = neighbours - np.einsum("nk,nkc->nc", shares, neighbours)[:, None]
    covariance = (shares[..., None] * offsets).swapaxes(1, 2) @ offsets
    normals = np.linalg.eigh(covariance)[1][:, :, 0]
    away = (normals * scan.to_scanner[rows]).sum(axis=1, keepdims=True) < 0
    return np.where(away, -normals, normals)


def _on_quadrics(
    points: np.ndarray, normals: np.ndarray, near: np.ndarray, weights: np.ndarray, rows: slice
) -> tuple[np.ndarray, np.ndarray]:
    """Points and normals (n, 3) of points on the height quadrics over their tangent planes."""
    own = normals[rows]
    unlike = np.linalg.norm(normals[near] - own[:, None], axis=-1)
    weights = weights * np.exp(-0.5 * (unlike / NORMAL_SCALE) ** 2)
    weights = weights / weights.sum(axis=1, keepdims=True)
    across, along = tangents(own)
    offsets = (points[near] - points[rows, None]) / NEIGHBOUR_SCALE
    x, y, z = np.moveaxis(offsets @ np.stack([across, along, own], axis=-1), -1, 0)
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)
    weighted = (terms * weights[..., None]).swapaxes(1, 2)
    normal_matrix = weighted @ terms + RIDGE
    heights = np.linalg.solve(normal_matrix, weighted @ z[..., None])[..., 0]
    tilted = own - heights[:, [1]] * across - heights[:, [2]] * along
    return (
        points[rows] + NEIGHBOUR_SCALE * heights[:, [0]] * own,
        tilted / np.linalg.norm(tilted, axis=1, keepdims=True),
    )


def tangents(normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors (n, 3) each, at right angles to one another and to unit normals (n, 3)."""
    upright = np.abs(normals[:, [2]]) < 0.9
    across = np.cross(normals, np.where(upright, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]]))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return across, np.cross(normals, across)


def settling_translations(scans: Sequence[ScanPoints]) -> np.ndarray | None:
    """(s, 3) translations, metres, that bring a rock's scans together; zero where they lie together as well as can be
    told.

    Distances are those between the scans' smooth surfaces, along normals, so a rock needs faces towards three sides
    that two scans share: None where points leave some direction open. The mean translation, weighted as the points are,
    is nil, so the rock stays where it is.

    Parameters
    ----------
    scans : sequence of ScanPoints
        The points of each scan on the rock; scans with few points stay where they are.
    """
    thinned = [voxel_means(scan, VOXEL) for scan in scans]
    usable = [number for number, scan in enumerate(thinned) if len(scan) >= LEAST_POINTS]
    if len(usable) < 2:
        return None
    parts = [surface_cloud(thinned[number]) for number in usable]
    trees = [KDTree(part.points) for part in parts]
    moved: np.ndarray = np.zeros((len(usable), 3))
    variances = []
    for limit in LIMITS:
        normal, right, variance = _equations(parts, trees, moved, limit)
        variances.append(variance)
        pairs, least_eigenvalue = np.trace(normal) / 2, np.linalg.eigvalsh(normal)[_FREE]
        if least_eigenvalue < LEAST_TOLD * pairs or variance > LARGEST_SD**2 * least_eigenvalue:
            return None
        moved = np.linalg.solve(normal / variance + np.eye(len(normal)) / TRANSLATION_SD**2, right / variance).reshape(
            -1, 3
        )
    translations = np.zeros((len(scans), 3))
    if _equations(parts, trees, moved, LIMITS[0])[2] > (1 - EXPLAINED) * variances[0]:
        return translations
    weights = np.array([scans[number].weights.sum() for number in usable])
    translations[usable] = moved - weights @ moved / weights.sum()
    return np.round(translations, 7)  # the last bits of a solver never reach a file


def _equations(
    parts: list[Cloud], trees: Sequence[KDTree], moved: np.ndarray, limit: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """Normal matrix (3 s, 3 s) and right side of all translations, and a distance's variance, of all ordered pairs."""
    size = 3 * len(parts)
    normal, right, squares, total = np.zeros((size, size)), np.zeros(size), 0.0, 0.0
    for one, other in permutations(range(len(parts)), 2):
        between = moved[one] - moved[other]
        gap, nearest = trees[other].query(parts[one].points + between, distance_upper_bound=REACH)
        rows = np.flatnonzero(np.isfinite(gap))
        partner = np.asarray(nearest)[rows]
        direction = parts[other].normals[partner]
        facing = (parts[one].normals[rows] * direction).sum(axis=1) > ALIKE
        unmoved = ((parts[one].points[rows] - parts[other].points[partner]) * direction).sum(axis=1)
        left = unmoved + direction @ between
        weights = np.clip(1 - (left / limit) ** 2, 0, 1) ** 2 * facing
        slopes = np.zeros((len(rows), size))
        slopes[:, 3 * one : 3 * one + 3] = direction
        slopes[:, 3 * other : 3 * other + 3] = -direction
        normal += (slopes * weights[:, None]).T @ slopes
        right -= slopes.T @ (weights * unmoved)
        squares, total = squares + float(weights @ left**2), total + float(weights.sum())
    return normal, right, squares / max(total, 1.0) + 1e-12
