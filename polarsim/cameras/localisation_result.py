"""Result of the localisation of a terrain's rigs by any method."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from polarsim.cameras.rounding import rounded, rounded_metrics
from polarsim.geometry.poses import Pose, yaw_pitch_roll
from polarsim.geometry.stereo import StereoRig
from polarsim.run_files.rigs import LocalisedRig
from polarsim.run_files.survey import surveyed_pose
from polarsim.site_parts import Tripod


@dataclass(frozen=True)
class LocalisationResult:
    """Localised rigs, and tables of their quality by file name."""

    localised: dict[str, LocalisedRig]
    details: dict[str, pd.DataFrame]
    unconfirmed: Mapping[str, LocalisedRig] = field(default_factory=dict)  # unconfirmed poses of further positions


def localised_rig(
    rig: StereoRig,
    position: str,
    pose: Pose,
    method: str,
    metrics: Mapping[str, float],
    tripods: Mapping[str, Tripod],
) -> LocalisedRig:
    """Return a rig with rounded pose and metrics, and the distance of the pose from the survey."""
    offsets = _survey_offsets(position, pose, tripods)
    return LocalisedRig(rig, rounded(pose), method, rounded_metrics({**metrics, **offsets}))


def _survey_offsets(position: str, pose: Pose, tripods: Mapping[str, Tripod]) -> dict[str, float]:
    """Return distance and heading difference between a tripod and its surveyed pose."""
    if position not in tripods:
        return {}
    surveyed = surveyed_pose(tripods[position])
    yaw = np.degrees(yaw_pitch_roll(pose)[0] - yaw_pitch_roll(surveyed)[0])
    return {
        "off_survey_m": float(np.linalg.norm(pose.translation - surveyed.translation)),
        "off_survey_deg": float((yaw + 180) % 360 - 180),
    }
