"""Refinement of the pose of a view on box edges: rocks and boxes are paired and the pose is fitted, repeatedly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.optimize import least_squares

from polarsim.geometry import boxes as box_geometry
from polarsim.geometry.boxes import match_by_position_and_size, match_gate_px
from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.geometry.outlines import EDGES, Outlines
from polarsim.geometry.poses import Pose, camera_pose, yaw_pitch_roll
from polarsim.photo import photo_scale

MIN_IN_VIEW = 0.5  # minimum share of a rock's box inside the photo


@dataclass(frozen=True)
class EdgeNoise:
    """Noise model of box edges, for photos of the reference width."""

    edge_px: float  # standard deviation of an annotated edge
    border_px: float  # edges within this distance of the image border are not measured
    loss: Literal["soft_l1", "cauchy"] = "soft_l1"
    loss_scale: float = 1.0


@dataclass(frozen=True)
class PosePrior:
    """Prior of a pose: centre (metres), yaw, pitch, roll (radians)."""

    mean: np.ndarray  # (6,)
    sd: np.ndarray  # (6,); infinite for unknowns without a prior

    def residuals(self, unknowns: np.ndarray) -> np.ndarray:
        """Return (6,) residuals in standard deviations."""
        off = unknowns - self.mean
        off[3:] = (off[3:] + np.pi) % (2 * np.pi) - np.pi
        return np.asarray(off / self.sd)

    def chi2(self, pose: Pose) -> float:
        return float((self.residuals(unknowns_of(pose)) ** 2).sum())


@dataclass(frozen=True)
class BoxFit:
    """Pose, and the matched pairs of outlines and boxes."""

    sandbox_from_left: Pose
    outline: np.ndarray  # (n,) indices of outlines
    box: np.ndarray  # (n,) indices of boxes
    projected: np.ndarray  # (m, 4) boxes of all outlines, clipped at the image border
    iou: np.ndarray  # (n,)
    in_view: int  # number of outlines inside the photo
    covariance: np.ndarray  # (6, 6) of centre (metres) and yaw, pitch, roll (radians)

    @property
    def sum_iou(self) -> float:
        return float(self.iou.sum())


def refine_pose(
    start: Pose,
    outlines: Outlines,
    boxes: np.ndarray,
    lens: Lens,
    prior: PosePrior,
    gates_px: Sequence[float],
    noise: EdgeNoise,
) -> Pose:
    """Return the pose after a least-squares fit per gate, each to the pairs at the previous pose."""
    pose = start
    for gate in gates_px:
        rows, columns = match_by_position_and_size(outlines.seen(Camera(pose, lens)), boxes, gate)
        if not len(rows):
            return pose
        pose = _solve(pose, EdgeProblem(outlines.part(rows), boxes[columns], lens, prior, noise))
    return pose


def check_pose(
    pose: Pose, outlines: Outlines, boxes: np.ndarray, lens: Lens, prior: PosePrior, noise: EdgeNoise
) -> BoxFit:
    """Return pairs, overlap and covariance at a pose."""
    unclipped = outlines.project(Camera(pose, lens))
    projected = box_geometry.clip(unclipped, lens.width, lens.height)
    rows, columns = match_by_position_and_size(projected, boxes, match_gate_px(lens.width))
    overlap = np.diag(box_geometry.iou(np.nan_to_num(projected[rows]), boxes[columns])).copy()
    with np.errstate(invalid="ignore", divide="ignore"):
        in_view = box_geometry.area(projected) >= MIN_IN_VIEW * box_geometry.area(unclipped)
    problem = EdgeProblem(outlines.part(rows), boxes[columns], lens, prior, noise)
    return BoxFit(pose, rows, columns, projected, overlap, int(in_view.sum()), problem.covariance(pose))


@dataclass(frozen=True)
class EdgeProblem:
    """Matched outlines and boxes; unknowns are the centre (3), yaw, pitch and roll."""

    outlines: Outlines
    boxes: np.ndarray  # (n, 4)
    lens: Lens
    prior: PosePrior
    noise: EdgeNoise

    def measured(self) -> np.ndarray:
        """Return a mask (n, 4) of the edges that the image border does not cut."""
        far = np.array([self.lens.width, self.lens.height] * 2)
        border = self.noise.border_px * photo_scale(self.lens.width)
        return (self.boxes > border) & (self.boxes < far - border)

    @property
    def edge_sd(self) -> float:
        """Standard deviation of an edge, px of the photo."""
        return self.noise.edge_px * photo_scale(self.lens.width)

    def residuals(self, unknowns: np.ndarray) -> np.ndarray:
        projected = self.outlines.project(Camera(pose_of_unknowns(unknowns), self.lens))
        edges = np.where(self.measured(), projected - self.boxes, 0.0)
        edges = np.nan_to_num(edges, nan=1e3, posinf=1e3, neginf=-1e3)
        return np.concatenate([edges.ravel() / self.edge_sd, self.prior.residuals(unknowns)])

    def jacobian(self, unknowns: np.ndarray) -> np.ndarray:
        """Return the derivatives (4 n + 6, 6); an edge moves with the point that defines it."""
        pose = pose_of_unknowns(unknowns)
        _, points = self.outlines.edges(Camera(pose, self.lens))
        camera_from_sandbox = pose.inverse()
        in_camera = camera_from_sandbox.apply(points)
        moved = _motion_jacobian(points - pose.translation, pose, unknowns[3])  # (n, 4, 3, 6) sandbox axes
        moved_camera = np.einsum("ij,nejk->neik", camera_from_sandbox.rotation, moved)
        slope = _projection_slope(self.lens, in_camera)  # (n, 4, 2, 3)
        axis = np.arange(EDGES) % 2  # left and right edges are u, top and bottom v
        edge_slope = slope[:, np.arange(EDGES), axis]  # (n, 4, 3)
        rows = np.einsum("nej,nejk->nek", edge_slope, moved_camera) * self.measured()[..., None]
        return np.concatenate([np.nan_to_num(rows).reshape(-1, 6) / self.edge_sd, np.diag(1 / self.prior.sd)])

    def covariance(self, pose: Pose) -> np.ndarray:
        """Return the formal covariance (6, 6), scaled by the robust spread of the edges if that is larger."""
        unknowns = unknowns_of(pose)
        residuals, jacobian = self.residuals(unknowns), self.jacobian(unknowns)
        edges = residuals[:-6]
        spread = 1.4826 * np.median(np.abs(edges)) if len(edges) else 0.0
        return np.asarray(np.linalg.pinv(jacobian.T @ jacobian) * max(1.0, spread) ** 2)


def _solve(start: Pose, problem: EdgeProblem) -> Pose:
    fit = least_squares(
        problem.residuals,
        unknowns_of(start),
        problem.jacobian,
        loss=problem.noise.loss,
        f_scale=problem.noise.loss_scale,
        x_scale=np.array([0.1, 0.1, 0.1, 0.03, 0.03, 0.03]),
        max_nfev=30,
    )
    return pose_of_unknowns(fit.x)


def unknowns_of(pose: Pose) -> np.ndarray:
    """Return (6,) centre in metres, yaw, pitch, roll in radians."""
    return np.concatenate([pose.translation, yaw_pitch_roll(pose)])


def pose_of_unknowns(unknowns: np.ndarray) -> Pose:
    """Return the pose of unknowns; the inverse of `unknowns_of`."""
    return camera_pose(unknowns[:3], *unknowns[3:])


def _motion_jacobian(from_centre: np.ndarray, pose: Pose, yaw: float) -> np.ndarray:
    """Return the derivatives (..., 3, 6) of points relative to the camera, in sandbox axes, by each unknown.
    A camera that rotates about an axis sees the world rotate the other way: -axis x point. Yaw rotates about up, pitch
    about minus the level right axis, roll about the optical axis.
    """
    level_right = np.array([np.sin(yaw), -np.cos(yaw), 0.0])
    axes = np.stack([np.array([0.0, 0.0, 1.0]), -level_right, pose.rotation[:, 2]])
    rotations = [np.cross(from_centre, axis) for axis in axes]
    translations = [np.broadcast_to(-np.eye(3)[k], from_centre.shape) for k in range(3)]
    return np.stack([*translations, *rotations], axis=-1)


def _projection_slope(lens: Lens, points: np.ndarray) -> np.ndarray:
    """Return the derivatives (..., 2, 3) of a pixel by the point in the camera frame, by central differences."""
    step = 1e-6
    columns = [
        (lens.project(points + offset) - lens.project(points - offset)) / (2 * step) for offset in step * np.eye(3)
    ]
    return np.stack(columns, axis=-1)
