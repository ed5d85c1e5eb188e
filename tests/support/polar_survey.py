"""Surveyed lamps, tripods and sandbox of NASA's POLAR as arrays and poses."""

import numpy as np

from polarsim.cameras.search import SearchRanges
from polarsim.cameras.search_area import SearchArea
from polarsim.geometry.poses import Pose
from polarsim.run_files import survey
from polarsim.run_files.walls import surely_wall
from polarsim.site import polar

SANDBOX = polar().sandbox
HALF = np.array(SANDBOX.half_width_m)
SURELY_WALL = surely_wall(SANDBOX)
TRIPODS = polar().tripods
STATIONS = survey.surveyed_poses(TRIPODS)
RANGES = SearchRanges.of(SANDBOX, TRIPODS)
AREA = SearchArea.of(polar(), 1)
SUN_LAMPS = {name: np.array(lamp.point) for name, lamp in polar().lamps.items()}
SURVEYED_LEFT = {name: np.array(tripod.camera_m) for name, tripod in polar().tripods.items()}
RIG_LAMP = polar().rig_lamp


def lamp_position(azimuth: str, lift: float = 0.0) -> np.ndarray:
    return SUN_LAMPS[azimuth] + np.array([0.0, 0.0, lift])


def surveyed_pose(position: str) -> Pose:
    return STATIONS[position]
