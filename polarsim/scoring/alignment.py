"""One rigid motion a terrain: the frame of our cameras, brought onto the true one before comparing.

Scans determine a terrain up to where its origin is said to be. So the frames of truth and result may differ by a motion
that is nobody's error; errors are what is left after the best one.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError, RegistrationError, about
from polarsim.geometry.poses import Pose, fit_pose
from polarsim.run_files.rigs import LocalisedRig, read_all_localised
from polarsim.scoring.surface import Surface

ARM = 4.0  # metres: about how far the sand is, where a rotation by a quarter of a milliradian weighs as a millimetre
_AXES = np.concatenate([np.zeros((1, 3)), ARM * np.eye(3), -ARM * np.eye(3)])

TRANSLATION_SD, ROTATION_SD = 0.02, np.radians(0.3)  # metres, radians: how far the cameras' alignment may be off
PATCHES, PATCH_SD = 1600, 0.002  # square decimetres of sand, each with an error of its own of this size, metres
ICP_STEPS = 12
ICP_GATES = (0.03, 0.003)  # metres: pairs farther apart are left out, at the first and at the last step


def fit_alignment(estimated: Mapping[str, Pose], true: Mapping[str, Pose]) -> Pose:
    """`truth_from_sandbox` that best brings estimated camera poses onto the true ones, over their common positions.

    Centres alone leave a rotation about their line free. So each camera counts as its centre and the ends of arms of
    length `ARM` along its axes, and the points are fitted in the least-squares sense.

    Raises
    ------
    RegistrationError
        No position is in both.
    """
    common = sorted(set(estimated) & set(true))
    if not common:
        raise RegistrationError(f"no common position: {sorted(estimated)} localised, {sorted(true)} true")
    return fit_pose(
        np.concatenate([estimated[position].apply(_AXES) for position in common]),
        np.concatenate([true[position].apply(_AXES) for position in common]),
    )


def read_alignment(cameras: Path, truth: Path) -> Pose:
    """`truth_from_sandbox` of a terrain by its cameras.

    Raises
    ------
    RegistrationError
        Truth and result have no position in common.
    FormatError
        A camera file is broken.
    """
    localised, true = read_all_localised(cameras), read_all_localised(truth / "cameras")
    if not true:
        raise FormatError("no PosX.json", path=truth / "cameras")
    with about(cameras):
        return align_rigs(localised, true)


def align_rigs(localised: Mapping[str, LocalisedRig], true: Mapping[str, LocalisedRig]) -> Pose:
    """`truth_from_sandbox` by the left cameras of all common positions."""
    return fit_alignment(
        {position: rig.sandbox_from_left for position, rig in localised.items()},
        {position: rig.sandbox_from_left for position, rig in true.items()},
    )


def refine_alignment(truth_from_sandbox: Pose, ground_truth: np.ndarray, surface_sandbox: Surface) -> Pose:
    """The alignment that brings our surface onto points of the true ground (n, 3): point-to-plane ICP with a closing
    gate.

    Errors of camera poses would count as errors of shape without this step: a rotation of 0.02 degrees moves a rock at
    three metres by a millimetre. Rocks are left out, for those that are all too large would pull the frame along. Level
    ground says nothing of motions along it; there the cameras' alignment holds, by `TRANSLATION_SD` and `ROTATION_SD`.
    """
    pose = truth_from_sandbox
    moved = np.zeros(6)  # rotation and translation so far, in the sandbox about the points' centre
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
