"""Surveyed poses: starts, priors, and poses of positions without scans and labels."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from polarsim import survey
from polarsim.geometry.poses import Pose, camera_pose, surveyed_pose, yaw_pitch_roll
from polarsim.photo import Terrain

# The rig was tilted again for C, but only moved back from A to B: on six terrains the pitches of A and B, 21.8 to 28.4
# degrees, differ by at most 1.1 degrees.
SAME_TILT = {"A": "B", "B": "A"}
USUAL_PITCH_DEG, USUAL_PITCH_SD_DEG = 25.4, 2.3  # downwards, mean and standard deviation of 18 localised positions
SHARED_PITCH_SD_DEG = 0.8  # of the difference between A and B


def stations(terrain: Terrain) -> dict[str, Pose]:
    """Return `sandbox_from_left` of the nominal stations by position; empty for terrains without survey."""
    if not survey.is_surveyed(terrain):
        return {}
    return {position: pose for position in survey.SURVEYED_LEFT if (pose := surveyed_pose(position)) is not None}


def offset_surveyed_pose(position: str, localised: Mapping[str, Pose]) -> Pose | None:
    """Return the surveyed pose, translated by the mean offset of the other positions from their surveyed poses.

    Every terrain has a separate frame, so that its tripods share part of their offset from the survey, but not tilts.
    """
    surveyed = surveyed_pose(position)
    if surveyed is None:
        return None
    offsets = [
        pose.translation - surveyed_other.translation
        for other, pose in sorted(localised.items())
        if other != position and (surveyed_other := surveyed_pose(other)) is not None
    ]
    return Pose(surveyed.rotation, surveyed.translation + (np.mean(offsets, axis=0) if offsets else 0.0))


def expected_survey_pose(position: str, localised: Mapping[str, Pose]) -> tuple[Pose, float] | None:
    """Return the most likely pose of a position without evidence, and the standard deviation of its pitch, degrees.

    It is `offset_surveyed_pose` with the pitch of the position that shares the tilt, or the usual pitch; None for
    positions that the survey does not include. Boxes of 03, 04, 08, 11, 12 that the ground transfers by this pose from
    left to right photos match annotated boxes with F1 0.76, by `offset_surveyed_pose` with F1 0.57.
    """
    pose = offset_surveyed_pose(position, localised)
    if pose is None:
        return None
    neighbour = localised.get(SAME_TILT.get(position, ""))
    pitch = np.radians(USUAL_PITCH_DEG) if neighbour is None else yaw_pitch_roll(neighbour)[1]
    sd_deg = USUAL_PITCH_SD_DEG if neighbour is None else SHARED_PITCH_SD_DEG
    return camera_pose(pose.translation, yaw_pitch_roll(pose)[0], float(pitch)), sd_deg
