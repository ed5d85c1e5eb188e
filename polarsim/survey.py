"""NASA's survey of tripods and lamps. Its errors reach decimetres: use it as initial value only.

Sandbox frame, metres: origin at the terrain centre on the ground, +X to Sun azimuth 0, +Y to azimuth 90, +Z up.
Source: table of the POLAR-Sim release (from NASA's document), heights raised to the sand level by `HEIGHT_OFFSET`.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from polarsim.photo import Terrain, terrain_text

HEIGHT_OFFSET = 0.20  # zero level of survey heights above the sand; fits to labels yield 0.16 to 0.22

# Left cameras. B and C are fitted to labels: the survey of B (x 5.5) contradicts "4000 mm from the edge", and on five
# terrains C is consistently 0.5 m from its survey (0.316, -3.540).
SURVEYED_LEFT = {
    "A": np.array([3.541, -0.303, 1.346 + HEIGHT_OFFSET]),
    "B": np.array([6.100, -0.403, 1.345 + HEIGHT_OFFSET]),
    "C": np.array([0.81, -3.675, 1.325 + HEIGHT_OFFSET]),
}
MAX_SURVEY_ERROR = 1.0  # maximum distance of a tripod of the sandbox from the surveyed position
NOMINAL_YAW_DEG = {"A": 180.0, "B": 180.0, "C": 103.0}  # heading of the optical axis, from +X towards +Y
NOMINAL_PITCH_DEG = 25.0  # downwards

SUN_LAMPS = {
    "30": np.array([3.594, 1.422, 0.583 + HEIGHT_OFFSET]),
    "180": np.array([-3.544, 0.475, 0.556 + HEIGHT_OFFSET]),
    "270": np.array([-0.271, -4.109, 0.591 + HEIGHT_OFFSET]),
    "350": np.array([4.026, -0.896, 0.551 + HEIGHT_OFFSET]),
}
ROVER_LIGHT_SHARE = 0.035  # radiant intensity relative to a Sun lamp
ROVER_LIGHT_FROM_LEFT = np.array([0.15, 0.0, 0.0])  # in the left camera's frame: midway between the cameras

POSITION_DISTANCE_MM = {"A": 1500, "B": 4000, "C": 1500}  # from the edge of the box, as in the names of NASA's folders
SANDBOX_HALF_WIDTH = 2.0  # of the sand inside the walls
# Terrain 13 is another box, about 1 m wide according to photos, with seven positions within decimetres. Its positions
# and wall height were not surveyed.
HALF_WIDTH_OF_OTHER_BOXES: dict[Terrain, float] = {13: 0.5}  # terrain -> half width, metres
WALL_HEIGHT = 0.30  # top of the walls above the sand; 0.29 to 0.36 in a photo of terrain 1
# Safety margin for objects that must not exceed any wall: 1 cm for the lowest wall, 1 cm for the sand level (a median).
WALL_MARGIN = 0.02
SURELY_WALL = round(WALL_HEIGHT - WALL_MARGIN, 2)  # minimum height of all walls above the sand
TERRAIN_NAMES: dict[Terrain, str] = {1: "LargeOnly", 3: "MeanDistr", 6: "Smooth", 11: "FreshCrater", 12: "OldCrater"}


def lamp_position(azimuth: str, lift: float = 0.0) -> np.ndarray:
    """Return the (3,) surveyed position of the Sun lamp of an azimuth, sandbox frame; KeyError for `no`.

    `lift` is added to the height, metres: see `survey_lift`.
    """
    return SUN_LAMPS[azimuth] + np.array([0.0, 0.0, lift])


def survey_lift(left: Mapping[str, np.ndarray]) -> float:
    """Return the height offset of the survey in the frame of a terrain, relative to `HEIGHT_OFFSET`, metres.

    Lamps and tripods were surveyed together, so the offset is the median offset of the located left cameras (position
    -> (3,), metres). The frames of published meshes were placed manually, with errors of up to 0.2 m. On the release,
    this offset yields a shadow F1 of 0.51 on terrain 11, the median height of the sand 0.45; terrains 01 and 04 do not
    differ. Cameras farther than `MAX_SURVEY_ERROR` from the survey are ignored, for example those of terrain 13.
    """
    heights = [
        centre[2]
        for position, centre in left.items()
        if position in SURVEYED_LEFT and np.hypot(*(centre - SURVEYED_LEFT[position])[:2]) <= MAX_SURVEY_ERROR
    ]
    usual = float(np.median([position[2] for position in SURVEYED_LEFT.values()]))
    return float(np.median(heights)) - usual if heights else 0.0


def half_width(terrain: Terrain) -> float:
    """Return half the width of the sand of a terrain inside the walls, metres."""
    return HALF_WIDTH_OF_OTHER_BOXES.get(terrain, SANDBOX_HALF_WIDTH)


def is_surveyed(terrain: Terrain) -> bool:
    """Return whether a terrain is in the sandbox with surveyed tripods, lamps and walls."""
    return terrain not in HALF_WIDTH_OF_OTHER_BOXES


def wall_height(terrain: Terrain, *, surely: bool = False) -> float:
    """Return the height of the walls above the sand of a terrain, metres; 0 if it was not surveyed.

    With `surely`, the minimum height of all walls.
    """
    stated = SURELY_WALL if surely else WALL_HEIGHT
    return stated if is_surveyed(terrain) else 0.0


def terrain_folder(terrain: Terrain) -> str:
    """Return the folder name of a terrain: `Terrain01_LargeOnly`, or `Terrain02_Unnamed` without a known name."""
    return f"Terrain{terrain_text(terrain)}_{TERRAIN_NAMES.get(terrain, 'Unnamed')}"
