"""Areas of a terrain in which scans are searched and compared, from the size of its sandbox."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.geometry.poses import Pose, camera_pose
from polarsim.photo import Terrain
from polarsim.site import Site

HALL = 1.2  # distance from the border of the sand beyond which points belong to the hall, metres
SAND_SHARE = 0.8  # of the half widths: scans show only sand and rocks there, despite the errors of the survey
FLOOR, FLOOR_SHOWN = 2.7, 1.1  # the same distances for a raised sandbox: its scans show the floor around it, metres
DEPTHS = (1.2, 9.0)  # minimum range of depths in photos of the sand, metres
NEAREST_SHARE, FARTHEST_MARGIN = 0.8, 0.4  # of depths: share of the height of a camera, and metres beyond the sand
CAMERA_DISTANCE, CAMERA_HEIGHT = 1.6, 1.55  # from the border, metres: start of a position that was not surveyed
GUESSED_PITCH_DEG = 25.0  # of the same start
MIN_AREA, MIN_AREA_SHARE = 1.0, 0.1  # minimum area of level sand, m^2, and at most this share of the area


@dataclass(frozen=True)
class SearchArea:
    """Half sides of rectangles about the centre of the terrain along X and Y, metres."""

    radius: np.ndarray  # (2,) points farther out belong to the hall
    sand: np.ndarray  # (2,) level ground, without walls
    start: Pose  # `sandbox_from_left` of a position that was not surveyed
    translation: float  # maximum error of the relative place of two scans
    half: np.ndarray  # (2,) border of the sand
    depths: tuple[float, float]  # minimum and maximum depth of the sand in photos

    @classmethod
    def of(cls, site: Site, terrain: Terrain) -> SearchArea:
        """Return the areas of a terrain."""
        sandbox, tripods = site.sandbox_of(terrain), site.tripods_of(terrain).values()
        half = np.array(sandbox.half_width_m)
        near, far = DEPTHS
        for tripod in tripods:
            x, y, height = tripod.camera_m
            corner = float(np.linalg.norm([abs(x) + half[0], abs(y) + half[1], height]))
            near, far = min(near, NEAREST_SHARE * height), max(far, corner + FARTHEST_MARGIN)
        radius = half + (FLOOR if sandbox.raised else HALL)
        sand = half + FLOOR_SHOWN if sandbox.raised else SAND_SHARE * half
        at = np.array([half[0] + (FLOOR - HALL if sandbox.raised else 0.0) + CAMERA_DISTANCE, 0.0, CAMERA_HEIGHT])
        return cls(
            radius,
            sand,
            camera_pose(at, np.pi, np.radians(GUESSED_PITCH_DEG)),
            site.max_survey_error_m,
            half,
            (near, far),
        )

    @property
    def min_sand_area(self) -> float:
        """Minimum area of level sand in a scan, m^2."""
        return min(MIN_AREA, MIN_AREA_SHARE * float(np.prod(2 * self.sand)))
