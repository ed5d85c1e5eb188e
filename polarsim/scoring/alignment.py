"""Rigid alignment of the sandbox frame of a run with the frame of the ground truth.

Scans determine a terrain up to the choice of the origin. The frames of ground truth and result may therefore differ by
a rigid motion, which is not an error. Errors are computed after the best rigid alignment.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError, RegistrationError, with_path
from polarsim.geometry.poses import Pose, fit_pose
from polarsim.run_files.rigs import LocalisedRig, read_all_localised
from polarsim.scoring.surface import Surface

ARM = 4.0  # metres; typical distance of the sand, at which a rotation by 0.25 mrad is equivalent to a millimetre
_AXES = np.concatenate([np.zeros((1, 3)), ARM * np.eye(3), -ARM * np.eye(3)])

TRANSLATION_SD, ROTATION_SD = 0.02, np.radians(0.3)  # metres, radians; uncertainty of the alignment by cameras
PATCHES, PATCH_SD = 1600, 0.002  # square decimetres of sand, and the independent error of each, metres
ICP_STEPS = 12
ICP_GATES = (0.03, 0.003)  # metres; maximum distance of pairs in the first and last step


def fit_alignment(estimated: Mapping[str, Pose], true: Mapping[str, Pose]) -> Pose:
    """Fit `truth_from_sandbox` to the estimated and true camera poses of the common positions by least squares.

    Camera centres do not determine the rotation about the line through the centres. Each camera is therefore
    represented by the centre and by the points at the distance `ARM` along the axes of the camera. Raises
    RegistrationError without a common position.
    """
    common = sorted(set(estimated) & set(true))
    if not common:
        raise RegistrationError(f"no common position: {sorted(estimated)} localised, {sorted(true)} true")
    return fit_pose(
        np.concatenate([estimated[position].apply(_AXES) for position in common]),
        np.concatenate([true[position].apply(_AXES) for position in common]),
    )


def read_alignment(cameras: Path, truth: Path) -> Pose:
    """Return `truth_from_sandbox` of a terrain, fitted to the cameras."""
    localised, true = read_all_localised(cameras), read_all_localised(truth / "cameras")
    if not true:
        raise FormatError("no PosX.json", path=truth / "cameras")
    with with_path(cameras):
        return align_rigs(localised, true)


def align_rigs(localised: Mapping[str, LocalisedRig], true: Mapping[str, LocalisedRig]) -> Pose:
    """Return `truth_from_sandbox`, fitted to the left cameras of all common positions."""
    return fit_alignment(
        {position: rig.sandbox_from_left for position, rig in localised.items()},
        {position: rig.sandbox_from_left for position, rig in true.items()},
    )


def refine_alignment(truth_from_sandbox: Pose, ground_truth: np.ndarray, surface_sandbox: Surface) -> Pose:
    """Align the surface of a run with points of the true ground (n, 3) by point-to-plane ICP with a shrinking gate.

    Without this step, errors of camera poses would count as errors of shape: a rotation by 0.02 degrees moves a rock at
    a distance of 3 m by 1 mm. Rocks are excluded, because a common size error of rocks would shift the frame. Level
    ground does not determine motions along the ground. For these, the alignment by cameras is the prior, with the
    standard deviations `TRANSLATION_SD` and `ROTATION_SD`.
    """
    pose = truth_from_sandbox
    moved = np.zeros(6)  # accumulated rotation and translation in the sandbox frame about the centre of the points
    centre = pose.inverse().apply(ground_truth.mean(axis=0))
    prior = np.diag(1 / np.array([ROTATION_SD] * 3 + [TRANSLATION_SD] * 3))
    for gate in np.geomspace(*ICP_GATES, ICP_STEPS):
        points = pose.inverse().apply(ground_truth)
        closest, face = surface_sandbox.nearest(points)
        normals = surface_sandbox.normals[face]
        near = np.linalg.norm(closest - points, axis=1) < gate
        if not near.any():
            return pose
        normals, points, closest = normals[near], points[near], closest[near]
        weight = np.sqrt(PATCHES / len(points)) / PATCH_SD
        rows = weight * np.concatenate([np.cross(points - centre, normals), normals], axis=1)
        offset = weight * np.einsum("nk,nk->n", closest - points, normals)
        step = np.linalg.lstsq(np.concatenate([rows, prior]), np.concatenate([offset, -prior @ moved]), rcond=None)[0]
        rotation = Pose.from_rotvec(step[:3], np.zeros(3))
        pose = pose @ Pose(rotation.rotation, centre - rotation.rotation @ centre + step[3:]).inverse()
        moved += step
    return pose
