"""The rover's own lights."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from polarsim.geometry.poses import Pose
from polarsim.render.lamps import REFERENCE_DISTANCE, Spot, beam_power
from polarsim.rover.vehicle.mounts import link_from_part
from polarsim.rover.vehicle.table import LightPart

# W/m2 of the Sun at 1 AU between 400 and 1000 nm, where a silicon sensor sees: 60 % of 1361, as of a black body of
# 5772 K. Sun lamps of intensity 1 stand for it.
SUN_IN_BAND_W_M2 = 810.0


def headlights(lights: Sequence[LightPart], world_from_link: Mapping[str, Pose]) -> dict[str, Spot]:
    """Lamps by name, where the rover's links are."""
    found = {}
    for light in lights:
        pose = world_from_link[light.link] @ link_from_part(light.position_m, light.yaw_deg, light.pitch_deg)
        found[light.name] = Spot(pose.translation, _intensity(light), axis=pose.rotation[:, 0], beam_deg=light.beam_deg)
    return found


def _intensity(light: LightPart) -> float:
    """Over that of a Sun lamp of intensity 1: what `power_w` in a beam of cos^m sends along its axis."""
    watts_per_steradian = light.power_w * (beam_power(light.beam_deg) + 1) / (2 * np.pi)
    return float(watts_per_steradian / REFERENCE_DISTANCE**2 / SUN_IN_BAND_W_M2)
