"""A small site that shares nothing with NASA's sandbox: named terrains, two lamps and a rig lamp, 640 x 480, 8 bits."""

from __future__ import annotations

from typing import Any

import numpy as np

from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose
from polarsim.geometry.stereo import StereoRig
from polarsim.site import Site

SIZE = (640, 480)
FOCAL_PX = 620.0
BASELINE_M = 0.12

CONTENT: dict[str, Any] = {
    "name": "yard",
    "terrains": ["yard-a", "yard-b"],
    "positions": ["gate", "mast"],
    "tripods": {
        "gate": {"camera_m": [2.6, 0.3, 1.2], "yaw_deg": 180},
        "mast": {"camera_m": [-0.4, -3.9, 1.4], "yaw_deg": 84, "pitch_deg": 20},
    },
    "lamps": {
        "45": {"position_m": [2.9, 2.9, 0.9]},
        "135": {"kind": "directional", "azimuth_deg": 135, "elevation_deg": 8},
    },
    "without_lamp": True,
    "rig_lamp": {"from_camera_m": [0.06, -0.05, 0], "share": 0.1},
    "exposures_ms": [10, 40, 160],
    "exposures_no_sun_ms": [640],
    "images": {"width": SIZE[0], "height": SIZE[1], "bits": 8, "black": 4},
    "cameras": {"stereo": True, "baseline_m": [0.1, 0.15]},
    "sandbox": {"half_width_m": [1.5, 3.0], "walls_m": {"-x": 0.2, "+x": 0.2, "+y": 0.2}},
    "files": {
        "photos": "{terrain}/{position}/{azimuth}-{light}/{camera}_{exposure_ms:4}.png",
        "clouds": "{terrain}/{position}.ply",
        "calibration": "{terrain}/camchain.yaml",
        "spelling": {
            "azimuth": {"no": "dark", "45": "lamp45", "135": "lamp135"},
            "camera": {"L": "left", "R": "right"},
        },
    },
}


def other_site(**changes: Any) -> Site:
    """Return the site, with other values of some keys."""
    return Site.model_validate(CONTENT | changes)


def one_camera(**changes: Any) -> Site:
    """Return the site with a single camera."""
    return other_site(cameras={"stereo": False}, **changes)


def other_rig() -> StereoRig:
    """Return the stereo rig of the site: parallel cameras, with slight distortion."""
    terms = (-0.05, 0.02, 1e-4, -2e-4, 0.0)
    left = Lens(FOCAL_PX, FOCAL_PX, 322.0, 238.0, terms, width=SIZE[0], height=SIZE[1])
    right = Lens(FOCAL_PX + 2, FOCAL_PX + 2, 318.0, 241.0, terms, width=SIZE[0], height=SIZE[1])
    return StereoRig(left, right, Pose(np.eye(3), np.array([BASELINE_M, 0.001, 0.0])))
