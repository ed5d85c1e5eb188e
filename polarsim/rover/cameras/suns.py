"""The Suns of a drive: four that the paper names, the real one over a place and at a date, and none."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.errors import RoverError
from polarsim.render.lamps import SUN_RADIUS_DEG, Lamp
from polarsim.render.views.moon import local_from_celestial, sun_over
from polarsim.rover.cameras.options import NIGHT, REAL, SUN_AZIMUTHS_DEG, CameraSuiteOptions


@dataclass(frozen=True)
class Sun:
    """A Sun's light, where it stands (from east to north), and how the stars lie over the world; no light at night."""

    name: str
    lamp: Lamp | None
    azimuth_deg: float
    elevation_deg: float
    world_from_celestial: np.ndarray  # (3, 3) rotation


def suns_of(options: CameraSuiteOptions) -> dict[str, Sun]:
    """All Suns by name, in the order of the options.

    Raises
    ------
    RoverError
        None is asked for, or the real one is down.
    """
    found: dict[str, Sun] = {name: _named(name, options.sun_elevation_deg) for name in options.suns}
    real = options.real_sun
    if real is not None:
        compass, height = sun_over(real.latitude_deg, real.longitude_deg, real.moment_utc)
        if height < -SUN_RADIUS_DEG:
            raise RoverError(
                f"suite: the Sun is {-height:.1f} degrees below the horizon at {real.moment_utc:%Y-%m-%d %H:%M}"
            )
        azimuth = (90 - compass) % 360
        sky = local_from_celestial(real.latitude_deg, real.longitude_deg, real.moment_utc)
        found[REAL] = Sun(REAL, Lamp.sun(azimuth, height), azimuth, height, sky)
    if not found:
        raise RoverError("suite: no Sun is asked for")
    return found


def _named(name: str, elevation_deg: float) -> Sun:
    if name == NIGHT:
        return Sun(name, None, 0.0, -90.0, np.eye(3))
    azimuth = SUN_AZIMUTHS_DEG[name]
    return Sun(name, Lamp.sun(azimuth, elevation_deg), azimuth, elevation_deg, np.eye(3))
