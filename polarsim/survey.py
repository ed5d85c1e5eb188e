"""NASA's survey: where tripods and lamps were said to stand. Decimetres off, so a start for estimates, never a result.

Sandbox frame, metres: origin at the terrain's centre on the ground, +X to Sun azimuth 0, +Y to azimuth 90, +Z up.
Source: the POLAR-Sim release's table (from NASA's document), heights lifted to the sand's level by `HEIGHT_OFFSET`.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

HEIGHT_OFFSET = 0.20  # survey heights count from a level this far above the sand: fits to labels give 0.16 to 0.22

# Left cameras. Two are fitted to labels: B, whose survey (x 5.5) contradicts "4000 mm from the edge", and C, which five
# terrains have 0.5 m beside its survey (0.316, -3.540), one like the other.
SURVEYED_LEFT = {
    "A": np.array([3.541, -0.303, 1.346 + HEIGHT_OFFSET]),
    "B": np.array([6.100, -0.403, 1.345 + HEIGHT_OFFSET]),
    "C": np.array([0.81, -3.675, 1.325 + HEIGHT_OFFSET]),
}
MAX_OFF_SURVEY = 1.0  # metres: no tripod of the sandbox stands farther from its surveyed position
NOMINAL_YAW_DEG = {"A": 180.0, "B": 180.0, "C": 103.0}  # heading of the optical axis, from +X towards +Y
NOMINAL_PITCH_DEG = 25.0  # downwards

SUN_LAMPS = {
    "30": np.array([3.594, 1.422, 0.583 + HEIGHT_OFFSET]),
    "180": np.array([-3.544, 0.475, 0.556 + HEIGHT_OFFSET]),
    "270": np.array([-0.271, -4.109, 0.591 + HEIGHT_OFFSET]),
    "350": np.array([4.026, -0.896, 0.551 + HEIGHT_OFFSET]),
}
ROVER_LIGHT_SHARE = 0.035  # radiant intensity of the rover light over that of a Sun lamp
ROVER_LIGHT_FROM_LEFT = np.array([0.15, 0.0, 0.0])  # in the left camera's frame: midway between the cameras

POSITION_DISTANCE_MM = {"A": 1500, "B": 4000, "C": 1500}  # from the box's edge, as NASA's folders are named
SANDBOX_HALF_WIDTH = 2.0  # of the sand inside the walls
# Terrain 13 is another box, about 1 m wide by its photos: seven positions within decimetres of each other, which nobody
# surveyed, nor how high its walls are.
SMALL_BOXES = {13: 0.5}  # terrain -> half width, metres
WALL_HEIGHT = 0.30  # of the walls' tops above the sand; a photo of terrain 1 has them at 0.29 to 0.36
# What must not reach over any wall stays so far below the stated height: 1 cm for the lowest top, 1 cm for the sand's
# level, which is a median.
WALL_MARGIN = 0.02
SURELY_WALL = round(WALL_HEIGHT - WALL_MARGIN, 2)  # every wall is at least so high above the sand
TERRAIN_NAMES = {1: "LargeOnly", 3: "MeanDistr", 6: "Smooth", 11: "FreshCrater", 12: "OldCrater"}


def lamp_position(azimuth: str, lift: float = 0.0) -> np.ndarray:
    """(3,) surveyed position of the Sun lamp of an azimuth, sandbox frame; `no` has none (KeyError).

    `lift` is how much higher than here the survey's level lies in the terrain's own frame, metres: see `survey_lift`.
    """
    return SUN_LAMPS[azimuth] + np.array([0.0, 0.0, lift])


def survey_lift(left: Mapping[str, np.ndarray]) -> float:
    """How much higher the survey's level lies in a terrain's frame than the usual 0.20 m above the survey's zero.

    Lamps and tripods were surveyed together, so lamps follow where the left cameras were found (position -> (3,),
    metres). The frames of published meshes were placed by hand and lie up to 0.2 m off. Tried on the release against
    the sand's median height: shadows of terrain 11 are met at F1 0.51 instead of 0.45, those of 01 and 04 alike.
    Cameras farther than `MAX_OFF_SURVEY` beside their station, as those of terrain 13, stand where nobody surveyed and
    tell nothing.
    """
    heights = [
        centre[2]
        for position, centre in left.items()
        if position in SURVEYED_LEFT and np.hypot(*(centre - SURVEYED_LEFT[position])[:2]) <= MAX_OFF_SURVEY
    ]
    usual = float(np.median([position[2] for position in SURVEYED_LEFT.values()]))
    return float(np.median(heights)) - usual if heights else 0.0


def half_width(terrain: int) -> float:
    """Half the width of a terrain's sand inside its walls, metres."""
    return SMALL_BOXES.get(terrain, SANDBOX_HALF_WIDTH)


def is_surveyed(terrain: int) -> bool:
    """Whether a terrain lies in the sandbox whose tripods, lamps and walls were stated."""
    return terrain not in SMALL_BOXES


def wall_height(terrain: int, *, surely: bool = False) -> float:
    """Height of the walls above a terrain's sand, metres; 0 where nobody stated it.

    With `surely`, the height that every wall has.
    """
    stated = SURELY_WALL if surely else WALL_HEIGHT
    return stated if is_surveyed(terrain) else 0.0


def terrain_folder(terrain: int) -> str:
    """Folder name of a terrain, `Terrain01_LargeOnly`; names that nobody knows are `Terrain02_Unnamed`."""
    return f"Terrain{terrain:02d}_{TERRAIN_NAMES.get(terrain, 'Unnamed')}"
