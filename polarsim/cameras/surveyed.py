"""Surveyed poses: starts, priors, and poses of positions without scans and labels."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from polarsim.geometry.poses import Pose, camera_pose, yaw_pitch_roll
from polarsim.run_files.survey import surveyed_pose
from polarsim.site_parts import Tripod

USUAL_PITCH_SD_DEG = 2.3  # of tilts that people set by eye: standard deviation of 18 localised positions of POLAR
SHARED_PITCH_SD_DEG = 0.8  # of a rig that was only moved: of the difference between POLAR's A and B on six terrains


def offset_surveyed_pose(position: str, localised: Mapping[str, Pose], tripods: Mapping[str, Tripod]) -> Pose | None:
    """Return the surveyed pose, translated by the mean offset of the other positions from their surveyed poses.

    Every terrain has a separate frame, so that its tripods share part of their offset from the survey, but not tilts.
    """
    if position not in tripods:
        return None
    surveyed = surveyed_pose(tripods[position])
    offsets = [
        pose.translation - surveyed_pose(tripods[other]).translation
        for other, pose in sorted(localised.items())
        if other != position and other in tripods
    ]
    return Pose(surveyed.rotation, surveyed.translation + (np.mean(offsets, axis=0) if offsets else 0.0))


def expected_survey_pose(
    position: str, localised: Mapping[str, Pose], tripods: Mapping[str, Tripod]
) -> tuple[Pose, float] | None:
    """Return the most likely pose of a position without evidence, and the standard deviation of its pitch, degrees.

    It is `offset_surveyed_pose` with the pitch of the position that shares the tilt, or the usual pitch; None for
    positions that the survey does not include. Boxes of 03, 04, 08, 11, 12 that the ground transfers by this pose from
    left to right photos match annotated boxes with F1 0.76, by `offset_surveyed_pose` with F1 0.57.
    """
    pose = offset_surveyed_pose(position, localised, tripods)
    if pose is None:
        return None
    tripod = tripods[position]
    neighbour = localised.get(tripod.same_tilt_as or "")
    pitch = np.radians(tripod.usual_pitch) if neighbour is None else yaw_pitch_roll(neighbour)[1]
    sd_deg = USUAL_PITCH_SD_DEG if neighbour is None else SHARED_PITCH_SD_DEG
    return camera_pose(pose.translation, yaw_pitch_roll(pose)[0], float(pitch)), sd_deg
