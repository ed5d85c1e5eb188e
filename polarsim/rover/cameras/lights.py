"""Light sources of a drive: the Suns of the paper, the real Sun over a site at a date, night, and the headlights."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from polarsim.errors import RoverError
from polarsim.geometry.poses import Pose
from polarsim.render.lamps import REFERENCE_DISTANCE, SUN_RADIUS_DEG, Lamp, Spotlight, beam_power
from polarsim.render.views.moon import local_from_celestial, sun_over
from polarsim.rover.cameras.options import NIGHT, REAL, SUN_AZIMUTHS_DEG, CameraSuiteOptions
from polarsim.rover.vehicle.mounts import link_from_part
from polarsim.rover.vehicle.table import LightPart

# W/m2 of the Sun at 1 AU between 400 and 1000 nm, the range of a silicon sensor: 60 % of 1361, for a black body of
# 5772 K. Sun lamps of intensity 1 represent this irradiance.
SUN_IN_BAND_W_M2 = 810.0


@dataclass(frozen=True)
class Sun:
    """Lamp of a Sun (None at night), its direction (azimuth from east to north) and the orientation of the stars."""

    name: str
    lamp: Lamp | None
    azimuth_deg: float
    elevation_deg: float
    world_from_celestial: np.ndarray  # (3, 3) rotation


def suns_of(options: CameraSuiteOptions) -> dict[str, Sun]:
    """Return all Suns by name, in the order of the options."""
    suns: dict[str, Sun] = {name: named_sun(name, options.sun_elevation_deg) for name in options.suns}
    real = options.real_sun
    if real is not None:
        compass, height = sun_over(real.latitude_deg, real.longitude_deg, real.moment_utc)
        if height < -SUN_RADIUS_DEG:
            raise RoverError(
                f"rover.cameras.real_sun: {-height:.1f} degrees below the horizon at {real.moment_utc:%Y-%m-%d %H:%M}"
            )
        azimuth = (90 - compass) % 360
        sky = local_from_celestial(real.latitude_deg, real.longitude_deg, real.moment_utc)
        suns[REAL] = Sun(REAL, Lamp.sun(azimuth, height), azimuth, height, sky)
    if not suns:
        raise RoverError("rover.cameras: no Sun is given; set suns or real_sun")
    return suns


def named_sun(name: str, elevation_deg: float) -> Sun:
    """Return a Sun of the paper, or night."""
    if name == NIGHT:
        return Sun(name, None, 0.0, -90.0, np.eye(3))
    azimuth_deg = SUN_AZIMUTHS_DEG[name]
    return Sun(name, Lamp.sun(azimuth_deg, elevation_deg), azimuth_deg, elevation_deg, np.eye(3))


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
