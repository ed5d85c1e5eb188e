"""Poses as the survey has them: starts, priors, and the last resort of a position that nothing else localises."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from polarsim import survey
from polarsim.geometry.poses import Pose, looking, surveyed_pose, yaw_pitch_roll

# The rig was tilted anew for C; from A to B it only moved back: on six terrains their pitches of 21.8 to 28.4 degrees
# differ by 1.1 at most.
SAME_TILT = {"A": "B", "B": "A"}
USUAL_PITCH_DEG, USUAL_PITCH_SD_DEG = 25.4, 2.3  # downwards, mean and standard deviation of 18 localised positions
SHARED_PITCH_SD_DEG = 0.8  # of A about B


def stations(terrain: int) -> dict[str, Pose]:
    """`sandbox_from_left` of the nominal stations of a terrain by position; none where nobody surveyed them."""
    if not survey.is_surveyed(terrain):
        return {}
    return {position: pose for position in survey.SURVEYED_LEFT if (pose := surveyed_pose(position)) is not None}


def pose_beside(position: str, localised: Mapping[str, Pose]) -> Pose | None:
    """The surveyed pose, moved as the terrain's other positions stand off theirs (mean offset; no rotation).

    Every terrain has its own frame, so its tripods share part of their distance from the survey; their tilts do not.
    """
    surveyed = surveyed_pose(position)
    if surveyed is None:
        return None
    offsets = [
        pose.translation - known.translation
        for other, pose in sorted(localised.items())
        if other != position and (known := surveyed_pose(other)) is not None
    ]
    return Pose(surveyed.rotation, surveyed.translation + (np.mean(offsets, axis=0) if offsets else 0.0))


def likely_pose(position: str, localised: Mapping[str, Pose]) -> tuple[Pose, float] | None:
    """The likeliest pose of a position without evidence of its own; None for positions that the survey does not have.

    It is `pose_beside`, tilted as the position whose tilt it shares, or as positions usually are; behind it the
    standard deviation of the pitch, degrees. Rocks drawn on left photos of 03, 04, 08, 11, 12 that the ground moves by
    it to the right photos meet drawn ones with F1 0.76, by `pose_beside` with 0.57.
    """
    pose = pose_beside(position, localised)
    if pose is None:
        return None
    neighbour = localised.get(SAME_TILT.get(position, ""))
    pitch = np.radians(USUAL_PITCH_DEG) if neighbour is None else yaw_pitch_roll(neighbour)[1]
    sd_deg = USUAL_PITCH_SD_DEG if neighbour is None else SHARED_PITCH_SD_DEG
    return looking(pose.translation, yaw_pitch_roll(pose)[0], float(pitch)), sd_deg
