"""Scans aligned with one another: Open3D's point-to-plane ICP from coarse to fine, with a loss that forgets outliers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from polarsim.geometry.poses import Pose

NORMAL_RADIUS = 4.0  # in voxels
NORMAL_NEIGHBOURS = 30
COARSE_VOXEL = 0.04  # metres
GATE = 3.0  # voxels: pairs further apart are none


@dataclass(frozen=True)
class Alignment:
    """How well two scans fit."""

    fixed_from_moving: Pose
    fitness: float  # part of the moving points with a partner
    rmse: float  # metres, of partners
    points: int


@dataclass(frozen=True)
class Thinned:
    """A scan on grids of several widths, coarse to fine, with normals; Open3D clouds."""

    voxels: tuple[float, ...]
    clouds: tuple[Any, ...]

    @classmethod
    def of(cls, points: np.ndarray, viewpoint: np.ndarray, finest: float) -> Thinned:
        """Thin points (n, 3), metres, to `finest` and its doubles; normals look towards the viewpoint (3,)."""
        import open3d as o3d

        voxels = [finest]
        while voxels[-1] * 2 <= COARSE_VOXEL:
            voxels.append(voxels[-1] * 2)
        fine = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
        clouds = []
        for voxel in voxels:
            fine = fine.voxel_down_sample(voxel)
            cloud = o3d.geometry.PointCloud(fine)
            cloud.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(NORMAL_RADIUS * voxel, NORMAL_NEIGHBOURS))
            cloud.orient_normals_towards_camera_location(viewpoint)
            clouds.append(cloud)
        return cls(tuple(voxels[::-1]), tuple(clouds[::-1]))

    def points(self, level: int = -1) -> np.ndarray:
        """(n, 3) points of one grid."""
        return np.asarray(self.clouds[level].points)


def align(fixed: Thinned, moving: Thinned, start: Pose, levels: slice, tukey: float) -> Alignment:
    """Refine `fixed_from_moving` from `start`, over the grids that `levels` picks from coarse to fine.

    The Tukey loss forgets points that are further off than `tukey` metres on the finest grid, in proportion on coarser.
    """
    import open3d as o3d

    registration = o3d.pipelines.registration
    matrix = start.matrix
    for voxel, cloud_fixed, cloud_moving in list(zip(fixed.voxels, fixed.clouds, moving.clouds, strict=True))[levels]:
        scale = tukey * voxel / fixed.voxels[-1]
        found = registration.registration_icp(
            cloud_moving,
            cloud_fixed,
            max(GATE * voxel, scale),
            matrix,
            registration.TransformationEstimationPointToPlane(registration.TukeyLoss(scale)),
            registration.ICPConvergenceCriteria(1e-7, 1e-7, 60),
        )
        matrix = found.transformation
    pose = Pose(np.array(matrix[:3, :3]), np.array(matrix[:3, 3]))
    return Alignment(pose, float(found.fitness), float(found.inlier_rmse), len(cloud_moving.points))
