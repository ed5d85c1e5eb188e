"""Joint adjustment of rig poses, lenses and the pose between the cameras to matched points in photos."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose
from polarsim.geometry.stereo import StereoRig
from polarsim.photo import PositionCamera, photo_scale
from polarsim.run_files.rigs import LocalisedRig

_STEPS = 30
_CONVERGED = 1e-4  # of a prior's standard deviation: smaller steps end the adjustment
_DIFFERENCE_STEP = 1e-4  # of a prior's standard deviation, for numeric derivatives
_OF_POSE, _OF_RIG, _OF_LENS = 6, 6, 4


@dataclass(frozen=True)
class MatchedPoints:
    """Matched points of a view."""

    points: np.ndarray  # (n, 3) points in the sandbox, metres
    pixels: np.ndarray  # (n, 2) measured positions of these points in the photos
    whitening: np.ndarray  # (n, 2, 2) converts an offset, px, to two components of standard deviation 1


@dataclass(frozen=True)
class CalibrationPriors:
    """Standard deviations of a calibration on each axis: pose between the cameras and lenses.

    Lengths in pixels are those of photos of the reference width.
    """

    rig_m: float
    rig_rad: float
    focal_px: float
    centre_px: float
    k1: float

    def scale(self, width: int) -> np.ndarray:
        """Return the standard deviations (14,) in the order of `changed_rig`, for photos of a width, px."""
        px = photo_scale(width)
        rig = [self.rig_rad] * 3 + [self.rig_m] * 3
        lens = [px * self.focal_px, px * self.centre_px, px * self.centre_px, self.k1]
        return np.array(rig + lens * 2)


REPEATABILITY = CalibrationPriors(  # of calibrations of the same rig
    rig_m=0.0005, rig_rad=float(np.radians(0.02)), focal_px=1.5, centre_px=1.5, k1=0.003
)


@dataclass(frozen=True)
class Priors:
    """Standard deviations of the poses and of the calibration before the adjustment."""

    pose_m: float
    pose_rad: float
    calibration: CalibrationPriors = REPEATABILITY

    def scale(self, positions: int, width: int, *, lenses: bool) -> np.ndarray:
        """Return the standard deviation of every unknown: poses, pose between the cameras, left lens, right lens."""
        pose = [self.pose_rad] * 3 + [self.pose_m] * 3
        return np.concatenate([pose * positions, self.calibration.scale(width) if lenses else []])


@dataclass(frozen=True)
class Adjustment:
    """Adjusted rigs, and the covariance (6, 6) of rotation, rad, and translation, m, of each pose in its left frame."""

    localised: dict[str, LocalisedRig]
    covariance: dict[str, np.ndarray]


def adjust(
    localised: Mapping[str, LocalisedRig],
    matched: Mapping[PositionCamera, MatchedPoints],
    priors: Priors,
    independent: int,
    lenses: bool,
) -> Adjustment:
    """Solve for all unknowns at once by Gauss-Newton steps with Cauchy weights.

    The derivatives are computed once, at the start: the corrections are a few pixels, over which they hardly change.

    `localised`, position -> LocalisedRig: the start, and the mean of the priors; all with the same calibration.
    `independent`: maximum weight of a view, in windows: the errors of neighbouring windows are correlated.
    `lenses`: whether the calibration, which all positions share, is adjusted too.
    """
    width = next(iter(localised.values())).rig.left.width
    scale = priors.scale(len(localised), width, lenses=lenses)
    unknowns = np.zeros(len(scale))
    slopes = _jacobians(localised, matched, scale)
    for _ in range(_STEPS):
        off = _residuals(_apply_changes(localised, unknowns * scale), matched)
        weights = [outlier_weights(part, independent) for part in off]
        information, pull = np.eye(len(scale)), unknowns.copy()
        for part, slope, weight in zip(off, slopes, weights, strict=True):
            root = np.sqrt(weight)
            rows = (slope * root[:, None, None]).reshape(-1, len(scale))
            information += rows.T @ rows
            pull += rows.T @ (part * root[:, None]).ravel()
        step = np.linalg.solve(information, pull)
        unknowns = unknowns - step
        if np.abs(step).max() < _CONVERGED:
            break
    covariance = np.linalg.inv(information) * np.outer(scale, scale)
    blocks = [slice(_OF_POSE * number, _OF_POSE * (number + 1)) for number in range(len(localised))]
    return Adjustment(
        _apply_changes(localised, unknowns * scale),
        {position: covariance[block, block] for position, block in zip(sorted(localised), blocks, strict=True)},
    )


def _apply_changes(localised: Mapping[str, LocalisedRig], unknowns: np.ndarray) -> dict[str, LocalisedRig]:
    rest = unknowns[_OF_POSE * len(localised) :]
    moved = {}
    for number, position in enumerate(sorted(localised)):
        start = localised[position]
        change = unknowns[_OF_POSE * number : _OF_POSE * (number + 1)]
        rig = changed_rig(start.rig, rest) if len(rest) else start.rig
        pose = start.sandbox_from_left @ Pose.from_rotvec(change[:3], change[3:])
        moved[position] = replace(start, rig=rig, sandbox_from_left=pose)
    return moved


def changed_rig(rig: StereoRig, change: np.ndarray) -> StereoRig:
    """Return a rig with a changed calibration.

    `change` (14,): rotation, radians, and translation, metres, between the cameras; then focal length, principal point,
    pixels, and k1 of the left and of the right lens. Only the changes of the left lens apply to a single camera.
    """
    left = _change_lens(rig.left, change[_OF_RIG : _OF_RIG + _OF_LENS])
    if not rig.is_stereo:
        return StereoRig.single(left)
    return replace(
        rig,
        left=left,
        right=_change_lens(rig.right, change[_OF_RIG + _OF_LENS :]),
        left_from_right=rig.left_from_right @ Pose.from_rotvec(change[:3], change[3:_OF_RIG]),
    )


def _change_lens(lens: Lens, change: np.ndarray) -> Lens:
    focal, cx, cy, k1 = map(float, change)
    return replace(
        lens, fx=lens.fx + focal, fy=lens.fy + focal, cx=lens.cx + cx, cy=lens.cy + cy,
        distortion=(lens.distortion[0] + k1, *lens.distortion[1:]),
    )  # fmt: skip


def offsets_px(rig: LocalisedRig, camera: str, points: MatchedPoints) -> np.ndarray:
    """Return (n, 2) offsets from measured to projected points, px; zero for points with z <= 0 in the camera frame."""
    return np.nan_to_num(rig.project(camera, points.points) - points.pixels)


def _residuals(
    localised: Mapping[str, LocalisedRig], matched: Mapping[PositionCamera, MatchedPoints]
) -> list[np.ndarray]:
    """Return the residuals (n, 2) of every view, in standard deviations."""
    return [
        whiten(offsets_px(localised[position], camera, points), points.whitening)
        for (position, camera), points in sorted(matched.items())
    ]


def _jacobians(
    localised: Mapping[str, LocalisedRig], matched: Mapping[PositionCamera, MatchedPoints], scale: np.ndarray
) -> list[np.ndarray]:
    """Return the derivatives (n, 2, unknowns) of every view at the start, by central differences."""
    columns = []
    for nudge in _DIFFERENCE_STEP * np.diag(scale):
        ahead, behind = (_residuals(_apply_changes(localised, sign * nudge), matched) for sign in (1, -1))
        columns.append([(a - b) / (2 * _DIFFERENCE_STEP) for a, b in zip(ahead, behind, strict=True)])
    return [np.stack(view, axis=-1) for view in zip(*columns, strict=True)]


def whiten(off: np.ndarray, whitening: np.ndarray) -> np.ndarray:
    """Convert offsets (n, 2), px, to standard deviations."""
    return np.einsum("nkl,nl->nk", whitening, off)


def outlier_weights(off: np.ndarray, independent: int) -> np.ndarray:
    """Return Cauchy weights (n,) of whitened offsets (n, 2); their sum never exceeds `independent`."""
    share = min(1.0, independent / max(1, len(off)))
    return np.asarray(share / (1 + np.einsum("nk,nk->n", off, off)))
