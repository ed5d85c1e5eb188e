"""Scans of one terrain brought together finely: what is left of pose and registration errors, millimetres, goes.

Point-to-plane ICP of all scans at once (Chen and Medioni, Image Vision Comput. 10 (1992) 145) with Tukey's biweight;
one thread and no random choice, so the same scans give the same poses.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from polarsim.geometry.poses import Pose
from polarsim.rocks.scans import ScanPoints

TARGETS, SAMPLES = 150_000, 5_000  # points of a scan that are met, and that look for others
NORMAL_NEIGHBOURS = 24
MAX_ROUGHNESS = 0.003  # metres of scatter about the local plane: beyond, a normal means little
MAX_DISTANCE = 0.020  # metres to the nearest point of another scan
TUKEY_LIMITS = (0.012, 0.012, 0.008, 0.008, 0.005, 0.005)  # metres, one an iteration
HOLD = 1e-3  # of a sample's weight: holds what scans do not determine; the weighted mean of all poses stays


@dataclass(frozen=True)
class _Samples:
    points: np.ndarray  # (n, 3)
    normals: np.ndarray  # (n, 3)
    tree: KDTree  # of the scan's target points
    weight: float  # of the scan as a whole


def alignment(scans: list[ScanPoints]) -> list[Pose]:
    """Corrections `sandbox_from_placed`, one a scan, that bring the scans' surfaces together.

    Nearer scans move less: the mean correction, weighted by 1 / range^2, is nil, so the terrain keeps its frame.
    """
    corrections = [Pose.identity() for _ in scans]
    usable = [number for number, scan in enumerate(scans) if len(scan) >= 10 * NORMAL_NEIGHBOURS]
    if len(usable) < 2:
        return corrections
    samples = {number: _sampled(scans[number]) for number in usable}
    for limit in TUKEY_LIMITS:
        steps = _step(samples, corrections, limit)
        for number, step in steps.items():
            corrections[number] = Pose.from_rotvec(step[:3], step[3:]) @ corrections[number]
    return [_rounded(correction) for correction in corrections]


def _sampled(scan: ScanPoints) -> _Samples:
    targets = scan.points[:: max(1, len(scan) // TARGETS)]
    tree = KDTree(targets)
    points = targets[:: max(1, len(targets) // SAMPLES)]
    near = targets[tree.query(points, k=NORMAL_NEIGHBOURS)[1]]
    offsets = near - near.mean(axis=1, keepdims=True)
    variances, axes = np.linalg.eigh(np.einsum("nkc,nkd->ncd", offsets, offsets) / NORMAL_NEIGHBOURS)
    even = variances[:, 0] < MAX_ROUGHNESS**2
    return _Samples(points[even], axes[even][:, :, 0], tree, float(scan.weights.mean()))


def _step(samples: dict[int, _Samples], corrections: list[Pose], limit: float) -> dict[int, np.ndarray]:
    """Small motions (rotation vector, translation) of every scan from one linearised least-squares fit."""
    place = {number: 6 * k for k, number in enumerate(samples)}
    size = 6 * len(samples)
    normal_matrix, right_side, pairs = np.zeros((size, size)), np.zeros(size), 0.0
    for one, source in samples.items():
        points, normals = corrections[one].apply(source.points), corrections[one].rotate(source.normals)
        for other, target in samples.items():
            if one == other:
                continue
            distance, nearest = target.tree.query(
                corrections[other].inverse().apply(points), distance_upper_bound=MAX_DISTANCE
            )
            found = np.isfinite(distance)
            met = corrections[other].apply(target.tree.data[np.where(found, nearest, 0)])
            left = ((points - met) * normals).sum(axis=1)
            weights = np.clip(1 - (left / limit) ** 2, 0, 1) ** 2 * found
            moves = np.zeros((len(points), size))
            moves[:, place[one] : place[one] + 6] = np.hstack([np.cross(points, normals), normals])
            moves[:, place[other] : place[other] + 6] = -np.hstack([np.cross(met, normals), normals])
            normal_matrix += (moves * weights[:, None]).T @ moves
            right_side -= moves.T @ (weights * left)
            pairs += weights.sum()
    total = sum(scan.weight for scan in samples.values())
    hold = np.concatenate([np.full(6, scan.weight / total) for scan in samples.values()])
    solution = np.linalg.solve(normal_matrix + HOLD * (pairs + 1) * np.diag(hold), right_side)
    return {number: solution[start : start + 6] for number, start in place.items()}


def _rounded(pose: Pose) -> Pose:
    """To a tenth of a micrometre, so that the last bits of a solver never reach a file."""
    return Pose(np.round(pose.rotation, 8), np.round(pose.translation, 7))
