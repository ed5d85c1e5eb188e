"""Light sources of a drive: the Suns of the paper, night, and the headlights."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from polarsim.geometry.poses import Pose
from polarsim.render.lamps import REFERENCE_DISTANCE, Lamp, Spotlight, beam_power
from polarsim.rover.cameras.options import NIGHT, SUN_AZIMUTHS_DEG
from polarsim.rover.vehicle.mounts import link_from_part
from polarsim.rover.vehicle.table import LightPart

# W/m2 of the Sun at 1 AU between 400 and 1000 nm, the range of a silicon sensor: 60 % of 1361, for a black body of
# 5772 K. Sun lamps of intensity 1 represent this irradiance.
SUN_IN_BAND_W_M2 = 810.0


def named_sun(name: str, elevation_deg: float) -> Lamp | None:
    """Return the lamp of a Sun of the paper; None at night."""
    return None if name == NIGHT else Lamp.sun(SUN_AZIMUTHS_DEG[name], elevation_deg)


def headlights(lights: Sequence[LightPart], world_from_link: Mapping[str, Pose]) -> dict[str, Spotlight]:
    """Return the lamps by name, at the current poses of their links."""
    spots = {}
    for light in lights:
        pose = world_from_link[light.link] @ link_from_part(light.position_m, light.yaw_deg, light.pitch_deg)
        spots[light.name] = Spotlight(
            pose.translation, _intensity(light), axis=pose.rotation[:, 0], beam_deg=light.beam_deg
        )
    return spots


def _intensity(light: LightPart) -> float:
    """Return the axial intensity of a cos^m beam of `power_w`, relative to a Sun lamp of intensity 1."""
    watts_per_steradian = light.power_w * (beam_power(light.beam_deg) + 1) / (2 * np.pi)
    return float(watts_per_steradian / REFERENCE_DISTANCE**2 / SUN_IN_BAND_W_M2)
