"""Scans laid on each other once more rock by rock, by small shifts: one motion of a scan may not fit all rocks."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations

import numpy as np
from scipy.spatial import KDTree

from polarsim.formats.ply import Cloud
from polarsim.rocks.clouds import surface_cloud, voxel_means
from polarsim.rocks.scans import ScanPoints

LEAST_POINTS = 50  # of a thinned scan on a rock: fewer tell nothing
VOXEL = 0.006  # metres to which scans are thinned
REACH = 0.009  # metres to a partner on the other scan
ALIKE = 0.9  # least cosine between partners' normals
LIMITS = (0.004, 0.003, 0.002, 0.002)  # metres from the partner's plane from which points have no say, one a round
SHIFT_SD = 0.001  # metres: how far a scan may lie off at a rock
LARGEST_SD = 0.0003  # metres: standard deviation of a shift, where points tell it least, that still is believed
LEAST_TOLD = 0.03  # of all pairs that must tell the direction told least: noise of normals is no slope
EXPLAINED = 0.5  # least share of the distances' variance that shifts must take away: shape alone feigns a millimetre
_FREE = 3  # directions along which all scans together may move


def settling_shifts(scans: Sequence[ScanPoints]) -> np.ndarray | None:
    """(s, 3) shifts, metres, that bring a rock's scans together; zero where they lie together as well as can be told.

    Distances are those between the scans' smooth surfaces, along normals, so a rock needs faces towards three sides
    that two scans share: None where points leave some direction open. The mean shift, weighted as the points are, is
    nil, so the rock stays in its place.

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
        pairs, least_told = np.trace(normal) / 2, np.linalg.eigvalsh(normal)[_FREE]
        if least_told < LEAST_TOLD * pairs or variance > LARGEST_SD**2 * least_told:
            return None
        moved = np.linalg.solve(normal / variance + np.eye(len(normal)) / SHIFT_SD**2, right / variance).reshape(-1, 3)
    shifts = np.zeros((len(scans), 3))
    if _equations(parts, trees, moved, LIMITS[0])[2] > (1 - EXPLAINED) * variances[0]:
        return shifts
    weights = np.array([scans[number].weights.sum() for number in usable])
    shifts[usable] = moved - weights @ moved / weights.sum()
    return np.round(shifts, 7)  # the last bits of a solver never reach a file


def _equations(
    parts: list[Cloud], trees: Sequence[KDTree], moved: np.ndarray, limit: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """Normal matrix (3 s, 3 s) and right side of all shifts, and the variance of a distance, of all ordered pairs."""
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
