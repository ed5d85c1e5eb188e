"""Surveyed poses of a site: approximate poses of its tripods, and the height of the survey in the frame of a terrain.

The survey of POLAR has errors of decimetres: it provides starts, priors, and poses of positions without evidence.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from polarsim.geometry.poses import Pose, camera_pose
from polarsim.run_files.rigs import LocalisedRig
from polarsim.site_parts import Tripod


def surveyed_pose(tripod: Tripod) -> Pose:
    """Return `sandbox_from_left` of a tripod, with level roll."""
    return camera_pose(np.array(tripod.camera_m), np.radians(tripod.yaw_deg), np.radians(tripod.pitch_deg))


def surveyed_poses(tripods: Mapping[str, Tripod]) -> dict[str, Pose]:
    """Return `sandbox_from_left` of tripods by position."""
    return {position: surveyed_pose(tripod) for position, tripod in tripods.items()}


def survey_lift(localised: Mapping[str, LocalisedRig], tripods: Mapping[str, Tripod], max_error_m: float) -> float:
    """Return the height offset of the survey in the frame of a terrain, metres; 0 without surveyed tripods.

    Lamps and tripods were surveyed together, so the offset is the median offset of the located left cameras. The frames
    of published meshes were placed manually, with errors of up to 0.2 m. On the POLAR-Sim release, this offset yields a
    shadow F1 of 0.51 on terrain 11, the median height of the sand 0.45; terrains 01 and 04 do not differ. Cameras whose
    horizontal distance from the survey exceeds `max_error_m` are ignored.
    """
    heights = []
    for position, rig in localised.items():
        centre = rig.sandbox_from_left.translation
        if position in tripods and np.hypot(*(centre - tripods[position].camera_m)[:2]) <= max_error_m:
            heights.append(centre[2])
    usual = float(np.median([tripod.camera_m[2] for tripod in tripods.values()])) if heights else 0.0
    return float(np.median(heights)) - usual if heights else 0.0
