"""Poses as the survey has them: starts, priors, and the last resort of a position that nothing else localises."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from polarsim import survey
from polarsim.geometry.poses import Pose, looking


def stations(terrain: int) -> dict[str, Pose]:
    """`sandbox_from_left` of the nominal stations of a terrain by position; none where nobody surveyed them."""
    if not survey.is_surveyed(terrain):
        return {}
    return {position: pose for position in survey.SURVEYED_LEFT if (pose := surveyed_pose(position)) is not None}


def surveyed_pose(position: str) -> Pose | None:
    """`sandbox_from_left` of a position's nominal station; None for positions that the survey does not have."""
    if position not in survey.SURVEYED_LEFT:
        return None
    return looking(
        survey.SURVEYED_LEFT[position],
        np.radians(survey.NOMINAL_YAW_DEG[position]),
        np.radians(survey.NOMINAL_PITCH_DEG),
    )


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
