"""Registration of scans: pairs by Open3D's ICP on coarse grids, then all scans at once on the fine grid.

Both minimise distances from points to local planes of the other scan, with Tukey's loss, which ignores surfaces that
the other scan does not show. The joint step weights each distance by its inverse variance, because distant scans are
noisier. It runs in NumPy with SciPy's tree, so that the output does not depend on the number of threads.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import permutations
from typing import Any

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from polarsim.geometry.poses import Pose

NORMAL_RADIUS = 4.0  # voxels
NORMAL_NEIGHBOURS = 24
PLANE_UNKNOWNS = 3
MIN_SPREAD = 0.0002  # minimum standard deviation of a point, metres
GATE = 3.0  # voxels: maximum distance of a pair
COARSE_SAMPLES = 6_000  # points of a scan in a coarse alignment
FINE_SAMPLES = 20_000  # points of a scan in the joint alignment
SLOPE_BINS = 5  # bins of each level component of the normals: flat parts must not outweigh steep parts
FACING_AWAY = 0.5  # minimum cosine between normals of points on the same surface
PARTNER_REACH = 0.04  # maximum distance of a pair, metres
TUKEY = 4.685  # standard deviations: 95 % efficient for Gaussian errors
WIDTHS = (4.0, 2.0, 1.0)  # factors of Tukey's scale, one per pass of the joint alignment
MAX_STEPS = 25  # maximum number of steps of a pass
ALIGNMENT_CONVERGED = 1e-7  # metres and radians: smaller steps end a pass
PATCH = 0.2  # metres: side of the patches of ground with independent errors


@dataclass(frozen=True)
class ScanSurface:
    """Scan thinned to a grid and smoothed: points and outward unit normals (n, 3), metres."""

    points: np.ndarray
    normals: np.ndarray
    spread: np.ndarray  # (n,) metres: standard deviation of a point along its normal

    @cached_property
    def tree(self) -> KDTree:
        return KDTree(self.points)

    @cached_property
    def cloud(self) -> Any:
        """Convert to a point cloud of Open3D."""
        import open3d as o3d

        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(self.points))
        cloud.normals = o3d.utility.Vector3dVector(self.normals)
        return cloud

    def select(self, chosen: np.ndarray) -> ScanSurface:
        """Select points by a mask or an index array (n,)."""
        return ScanSurface(self.points[chosen], self.normals[chosen], self.spread[chosen])

    def sample(self, count: int) -> ScanSurface:
        """Select about `count` points, evenly over slopes and, within a slope, evenly over the scan."""
        bins = np.clip(((self.normals[:, :2] + 1) / 2 * SLOPE_BINS).astype(int), 0, SLOPE_BINS - 1)
        slope = bins[:, 0] * SLOPE_BINS + bins[:, 1]
        shares = _fair_shares(np.bincount(slope, minlength=SLOPE_BINS**2), count)
        chosen = [_evenly(np.flatnonzero(slope == k), int(shares[k])) for k in range(SLOPE_BINS**2)]
        return self.select(np.sort(np.concatenate(chosen)))


@dataclass(frozen=True)
class Alignment:
    """Quality of the alignment of a moving scan with a fixed scan."""

    fitness: float  # share of the moving scan's samples on the surface of the fixed scan
    rmse: float  # metres, of these samples
    points: int  # samples


def thin_to_planes(points: np.ndarray, viewpoint: np.ndarray, voxel: float) -> ScanSurface:
    """Thin points (n, 3) to a grid of `voxel` metres and project each onto the plane through its neighbours.

    Normals point towards the viewpoint (3,). Points with few neighbours, such as threads, are removed.
    """
    import open3d as o3d

    thin = np.asarray(o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)).voxel_down_sample(voxel).points)
    thin = thin[np.lexsort(thin.T)]
    distance, near = map(
        np.asarray, KDTree(thin).query(thin, k=NORMAL_NEIGHBOURS, distance_upper_bound=NORMAL_RADIUS * voxel)
    )
    dense = np.isfinite(distance).all(axis=1)
    neighbours, kept = thin.take(near[dense], axis=0), thin[dense]
    centre = neighbours.mean(axis=1)
    offsets = neighbours - centre[:, None]
    scatter = np.einsum("nkc,nkd->ncd", offsets, offsets) / (NORMAL_NEIGHBOURS - PLANE_UNKNOWNS)
    variances, axes = np.linalg.eigh(scatter)
    normals = axes[:, :, 0]
    normals = np.where(((viewpoint - kept) * normals).sum(axis=1, keepdims=True) < 0, -normals, normals)
    on_plane = kept - ((kept - centre) * normals).sum(axis=1, keepdims=True) * normals
    # An upper bound: a plane is more accurate in the centre of its points than at their border.
    spread = np.sqrt(np.maximum(variances[:, 0], 0) * PLANE_UNKNOWNS / NORMAL_NEIGHBOURS)
    return ScanSurface(on_plane, normals, np.maximum(spread, MIN_SPREAD))


def align_coarsely(fixed: list[ScanSurface], moving: list[ScanSurface], voxels: list[float], start: Pose) -> Pose:
    """Return `fixed_from_moving` from Open3D's point-to-plane ICP over grids from coarse to fine."""
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


def align_jointly(surfaces: Mapping[str, ScanSurface], start: Mapping[str, Pose], reference: str) -> dict[str, Pose]:
    """Return the poses `reference_from_own` of all scans by Gauss-Newton over all ordered pairs.

    The pose of the reference is fixed; the choice of the reference does not affect the relative poses.
    """
    names = [name for name in sorted(surfaces) if name != reference]
    poses = dict(start)
    samples = {name: surfaces[name].sample(FINE_SAMPLES) for name in surfaces}
    for width in WIDTHS:
        for _ in range(MAX_STEPS):
            normal, right = np.zeros((6 * len(names), 6 * len(names))), np.zeros(6 * len(names))
            for pair in _pairs(names, surfaces, samples, poses, width):
                normal += (pair.slopes * pair.weights[:, None]).T @ pair.slopes
                right -= pair.slopes.T @ (pair.weights * pair.distances)
            step = np.linalg.solve(normal + 1e-9 * np.trace(normal) * np.eye(len(normal)), right).reshape(-1, 6)
            for name, change in zip(names, step, strict=True):
                poses[name] = Pose(Rotation.from_rotvec(change[:3]).as_matrix(), change[3:]) @ poses[name]
            if np.abs(step).max(initial=0) < ALIGNMENT_CONVERGED:
                break
    return poses


def covariances(surfaces: Mapping[str, ScanSurface], poses: Mapping[str, Pose]) -> dict[str, np.ndarray]:
    """Return the formal covariance (6, 6) of each scan's rotation (radians) and translation (metres).

    The mean of all scans is fixed. Neighbouring points share errors: smoothing, roughness seen from one side, stripes
    of the scanner. Therefore the gradients are squared by patch, not by point: the sandwich estimate over clusters
    (Liang and Zeger, Biometrika 73 (1986) 13), with Tukey's second derivative as bread.
    """
    names = sorted(surfaces)
    if len(names) == 1:
        return {names[0]: np.zeros((6, 6))}
    free = names[1:]  # first the first scan is fixed, then the mean of all scans
    samples = {name: surfaces[name].sample(FINE_SAMPLES) for name in names}
    bread, pulls, patches = np.zeros((6 * len(free), 6 * len(free))), [], []
    for pair in _pairs(free, surfaces, samples, poses, 1.0):
        bread += (pair.slopes * pair.bends[:, None]).T @ pair.slopes
        pulls.append(pair.slopes * (pair.weights * pair.distances)[:, None])
        patches.append(np.floor(pair.points[:, :2] / PATCH).astype(int))
    _, patch = np.unique(np.concatenate(patches), axis=0, return_inverse=True)
    pull = np.zeros((patch.max() + 1, 6 * len(free)))
    np.add.at(pull, patch.ravel(), np.concatenate(pulls))
    inverse = np.linalg.pinv(bread, rcond=1e-12, hermitian=True)
    held = np.zeros((6 * len(names), 6 * len(names)))
    held[6:, 6:] = inverse @ (pull.T @ pull) @ inverse
    mean_out = np.eye(6 * len(names)) - np.kron(np.full((len(names), len(names)), 1 / len(names)), np.eye(6))
    spread = mean_out @ held @ mean_out.T
    return {name: spread[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] for k, name in enumerate(names)}


def measure(fixed: ScanSurface, moving: ScanSurface, fixed_from_moving: Pose, tolerance: float) -> Alignment:
    """Measure an alignment; a sample is on the fixed scan if its plane is nearer than `tolerance` metres."""
    sample = moving.sample(FINE_SAMPLES)
    _, _, distance = _partners(fixed, sample, fixed_from_moving)
    near = np.abs(distance) < tolerance
    rmse = float(np.sqrt(np.mean(distance[near] ** 2))) if near.any() else 0.0
    return Alignment(float(near.sum() / len(sample.points)), rmse, len(sample.points))


@dataclass(frozen=True)
class _Pair:
    """Matched points of an ordered pair of scans."""

    points: np.ndarray  # (n, 3) points of the moving scan in the reference frame, metres
    distances: np.ndarray  # (n,) distances from the planes of the fixed scan, metres
    slopes: np.ndarray  # (n, 6 u) derivatives of the distances by rotations and translations of the u unknown scans
    weights: np.ndarray  # (n,) inverse variances times Tukey's weights
    bends: np.ndarray  # (n,) inverse variances times the second derivatives of Tukey's loss


def _pairs(
    names: list[str],
    surfaces: Mapping[str, ScanSurface],
    samples: Mapping[str, ScanSurface],
    poses: Mapping[str, Pose],
    width: float,
) -> Iterator[_Pair]:
    """Yield all ordered pairs; the scans of `names` are unknown, Tukey's scale is multiplied by `width`."""
    for moving, fixed in permutations(sorted(surfaces), 2):
        fixed_from_moving = poses[fixed].inverse() @ poses[moving]
        rows, partner, distances = _partners(surfaces[fixed], samples[moving], fixed_from_moving)
        variance = samples[moving].spread[rows] ** 2 + surfaces[fixed].spread[partner] ** 2
        near = np.clip(1 - (distances / (width * TUKEY)) ** 2 / variance, 0, None)
        points = poses[moving].apply(samples[moving].points[rows])
        direction = poses[fixed].rotate(surfaces[fixed].normals[partner])
        slope = np.concatenate([np.cross(points, direction), direction], axis=1)  # derivative by the moving scan
        slopes = np.zeros((len(rows), 6 * len(names)))
        for sign, name in ((1, moving), (-1, fixed)):
            if name in names:
                k = 6 * names.index(name)
                slopes[:, k : k + 6] = sign * slope
        yield _Pair(points, distances, slopes, near**2 / variance, near * (5 * near - 4) / variance)


def _partners(
    fixed: ScanSurface, sample: ScanSurface, fixed_from_moving: Pose
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return rows of the sample, their nearest points on the fixed scan, and the distances from their planes."""
    points = fixed_from_moving.apply(sample.points)
    gap, nearest = fixed.tree.query(points, distance_upper_bound=PARTNER_REACH)
    rows, partner = np.flatnonzero(np.isfinite(gap)), np.asarray(nearest)
    facing = (fixed_from_moving.rotate(sample.normals[rows]) * fixed.normals[partner[rows]]).sum(axis=1)
    rows = rows[facing > FACING_AWAY]
    partner = partner[rows]
    distance = ((points[rows] - fixed.points[partner]) * fixed.normals[partner]).sum(axis=1)
    return rows, partner, distance


def _fair_shares(available: np.ndarray, count: int) -> np.ndarray:
    """Split `count` evenly over bins, at most the available number per bin."""
    share = np.zeros(len(available), int)
    for _ in range(len(available)):
        short = available > share
        left = count - share.sum()
        if not short.any() or left < short.sum():
            break
        share = np.minimum(available, share + short * (left // short.sum()))
    return np.asarray(share)


def _evenly(rows: np.ndarray, count: int) -> np.ndarray:
    """Select `count` evenly spaced rows."""
    return rows[(np.arange(count) * len(rows)) // max(count, 1)]
