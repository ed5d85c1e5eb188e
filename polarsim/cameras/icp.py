"""Scans laid on each other: pairs by Open3D's ICP on coarse grids, then all scans at once on the fine grid.

Both minimise distances from points to the other scan's local planes, with Tukey's loss, which forgets what the other
scan does not show. The joint step runs in NumPy with SciPy's tree: the same bits whatever the number of threads.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import permutations
from typing import Any

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from polarsim.geometry.poses import Pose

NORMAL_RADIUS = 3.0  # in voxels
NORMAL_NEIGHBOURS = 24
GATE = 3.0  # voxels: pairs further apart are none
COARSE_SAMPLES = 6_000  # points of a scan in a coarse alignment
FINE_SAMPLES = 20_000  # points of a scan in the joint one
SLOPE_BINS = 5  # of the normals' two level components: every slope has its say, not only the wide flats
TURNED_AWAY = 0.5  # cosine between normals below which two points are of different surfaces
LEAST_GATE = 0.02  # metres: a partner may lie this far along the surface, whatever its distance from the plane
ROUNDS = 25  # of the joint alignment, at most
STILL = 1e-7  # metres and radians: smaller steps end it


@dataclass(frozen=True)
class Surface:
    """A scan thinned to a grid: points and outward unit normals (n, 3), metres."""

    points: np.ndarray
    normals: np.ndarray

    @cached_property
    def tree(self) -> KDTree:
        return KDTree(self.points)

    @cached_property
    def cloud(self) -> Any:
        """As Open3D has it."""
        import open3d as o3d

        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(self.points))
        cloud.normals = o3d.utility.Vector3dVector(self.normals)
        return cloud

    def sample(self, count: int) -> Surface:
        """About `count` points, spread over slopes and, within a slope, evenly over the scan."""
        bins = np.clip(((self.normals[:, :2] + 1) / 2 * SLOPE_BINS).astype(int), 0, SLOPE_BINS - 1)
        slope = bins[:, 0] * SLOPE_BINS + bins[:, 1]
        shares = _fair_shares(np.bincount(slope, minlength=SLOPE_BINS**2), count)
        chosen = [_evenly(np.flatnonzero(slope == k), int(shares[k])) for k in range(SLOPE_BINS**2)]
        rows = np.sort(np.concatenate(chosen))
        return Surface(self.points[rows], self.normals[rows])


@dataclass(frozen=True)
class Alignment:
    """How well a moving scan lies on a fixed one."""

    fixed_from_moving: Pose
    fitness: float  # part of the moving scan's samples that lie on the fixed one's surface
    rmse: float  # metres, of those
    points: int  # samples


def surface(points: np.ndarray, viewpoint: np.ndarray, voxel: float) -> Surface:
    """Thin points (n, 3) to a grid of `voxel` metres; normals look towards the viewpoint (3,)."""
    import open3d as o3d

    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)).voxel_down_sample(voxel)
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(NORMAL_RADIUS * voxel, NORMAL_NEIGHBOURS))
    cloud.orient_normals_towards_camera_location(viewpoint)
    return Surface(np.asarray(cloud.points), np.asarray(cloud.normals))


def align_coarsely(fixed: list[Surface], moving: list[Surface], voxels: list[float], start: Pose) -> Pose:
    """`fixed_from_moving` from Open3D's point-to-plane ICP over grids from coarse to fine."""
    import open3d as o3d

    registration = o3d.pipelines.registration
    matrix = start.matrix
    for on_fixed, on_moving, voxel in zip(fixed, moving, voxels, strict=True):
        matrix = registration.registration_icp(
            on_moving.sample(COARSE_SAMPLES).cloud,
            on_fixed.cloud,
            GATE * voxel,
            matrix,
            registration.TransformationEstimationPointToPlane(registration.TukeyLoss(voxel)),
            registration.ICPConvergenceCriteria(1e-6, 1e-6, 40),
        ).transformation
    return Pose(np.array(matrix[:3, :3]), np.array(matrix[:3, 3]))


def align_jointly(
    surfaces: Mapping[str, Surface], start: Mapping[str, Pose], reference: str, scales: list[float]
) -> dict[str, Pose]:
    """Poses `reference_from_own` of all scans at once: Gauss-Newton over all ordered pairs.

    Parameters
    ----------
    reference : str
        The scan that stays.
    scales : list of float
        Tukey's scale of one pass each, metres, from wide to narrow: points further off have no say.
    """
    names = [name for name in sorted(surfaces) if name != reference]
    poses = dict(start)
    samples = {name: surfaces[name].sample(FINE_SAMPLES) for name in surfaces}
    for scale in scales:
        for _ in range(ROUNDS):
            normal, right, _ = _normal_equations(names, surfaces, samples, poses, scale)
            step = np.linalg.solve(normal + 1e-9 * np.eye(len(normal)), right).reshape(-1, 6)
            for name, change in zip(names, step, strict=True):
                turn = Pose(Rotation.from_rotvec(change[:3]).as_matrix(), change[3:])
                poses[name] = turn @ poses[name]
            if np.abs(step).max(initial=0) < STILL:
                break
    return poses


def covariances(surfaces: Mapping[str, Surface], poses: Mapping[str, Pose], scale: float) -> dict[str, np.ndarray]:
    """(6, 6) formal covariance of each scan's turn (radians) and shift (metres), the mean of all scans held.

    All scans together may move freely; so the pseudo-inverse of the joint normal equations is taken, times the weighted
    variance of the distances. Errors that neighbouring points share make true errors larger.
    """
    names = sorted(surfaces)
    samples = {name: surfaces[name].sample(FINE_SAMPLES) for name in names}
    normal, _, (squares, weights) = _normal_equations(names, surfaces, samples, poses, scale)
    spread = squares / max(weights - 6 * len(names), 1.0) * np.linalg.pinv(normal, rcond=1e-9, hermitian=True)
    return {name: spread[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] for k, name in enumerate(names)}


def measure(fixed: Surface, moving: Surface, fixed_from_moving: Pose, tolerance: float) -> Alignment:
    """How the moving scan lies on the fixed one; a sample further from its plane than `tolerance` metres does not."""
    sample = moving.sample(FINE_SAMPLES)
    _, _, distance = _partners(fixed, sample, fixed_from_moving, tolerance)
    near = np.abs(distance) < tolerance
    rmse = float(np.sqrt(np.mean(distance[near] ** 2))) if near.any() else 0.0
    return Alignment(fixed_from_moving, float(near.sum() / len(sample.points)), rmse, len(sample.points))


def _normal_equations(
    names: list[str],
    surfaces: Mapping[str, Surface],
    samples: Mapping[str, Surface],
    poses: Mapping[str, Pose],
    scale: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Normal matrix and right side of all ordered pairs, unknowns of `names`; summed squares and weights (2,)."""
    normal, right, sums = np.zeros((6 * len(names), 6 * len(names))), np.zeros(6 * len(names)), np.zeros(2)
    for moving, fixed in permutations(sorted(surfaces), 2):
        sums += _add_pair(normal, right, names, fixed, moving, surfaces, samples, poses, scale)
    return normal, right, sums


def _add_pair(
    normal: np.ndarray,
    right: np.ndarray,
    names: list[str],
    fixed: str,
    moving: str,
    surfaces: Mapping[str, Surface],
    samples: Mapping[str, Surface],
    poses: Mapping[str, Pose],
    scale: float,
) -> tuple[float, float]:
    """Add one ordered pair's normal equations; unknowns are a turn and a shift of each scan in the reference frame.

    Gives the weighted sum of squared distances, and the sum of weights.
    """
    fixed_from_moving = poses[fixed].inverse() @ poses[moving]
    rows, partner, distance = _partners(surfaces[fixed], samples[moving], fixed_from_moving, scale)
    weight = np.clip(1 - (distance / scale) ** 2, 0, None) ** 2
    place = poses[moving].apply(samples[moving].points[rows])
    direction = poses[fixed].rotate(surfaces[fixed].normals[partner])
    slope = np.concatenate([np.cross(place, direction), direction], axis=1)  # of the distance, by the moving scan
    own = slope.T @ (slope * weight[:, None])
    pull = slope.T @ (weight * distance)
    for sign, name in ((1, moving), (-1, fixed)):
        if name not in names:
            continue
        k = 6 * names.index(name)
        normal[k : k + 6, k : k + 6] += own
        right[k : k + 6] -= sign * pull
    if fixed in names and moving in names:
        i, j = 6 * names.index(moving), 6 * names.index(fixed)
        normal[i : i + 6, j : j + 6] -= own
        normal[j : j + 6, i : i + 6] -= own
    return float((weight * distance**2).sum()), float(weight.sum())


def _partners(
    fixed: Surface, sample: Surface, fixed_from_moving: Pose, reach: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows of the sample, their nearest points on the fixed scan, and the distances from those points' planes."""
    points = fixed_from_moving.apply(sample.points)
    gap, nearest = fixed.tree.query(points, distance_upper_bound=max(LEAST_GATE, 2 * reach))
    rows, partner = np.flatnonzero(np.isfinite(gap)), np.asarray(nearest)
    facing = (fixed_from_moving.rotate(sample.normals[rows]) * fixed.normals[partner[rows]]).sum(axis=1)
    rows = rows[facing > TURNED_AWAY]
    partner = partner[rows]
    distance = ((points[rows] - fixed.points[partner]) * fixed.normals[partner]).sum(axis=1)
    return rows, partner, distance


def _fair_shares(available: np.ndarray, count: int) -> np.ndarray:
    """Split `count` over bins so that none gets more than it has, and the rest share alike."""
    share = np.zeros(len(available), int)
    for _ in range(len(available)):
        short = available > share
        left = count - share.sum()
        if not short.any() or left < short.sum():
            break
        share = np.minimum(available, share + short * (left // short.sum()))
    return np.asarray(share)


def _evenly(rows: np.ndarray, count: int) -> np.ndarray:
    """`count` of the rows, evenly spaced."""
    return rows[(np.arange(count) * len(rows)) // max(count, 1)]
