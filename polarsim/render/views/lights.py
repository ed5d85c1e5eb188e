"""What lights novel views: lamps, the Sun by its direction, the real Sun over a place on the Moon."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import timedelta
from itertools import product

import numpy as np

from polarsim.errors import ConfigError
from polarsim.geometry.poses import Pose
from polarsim.render.lamps import ROVER, SUN_RADIUS_DEG, Lamp
from polarsim.render.views.cameras import NamedCamera
from polarsim.render.views.moon import local_from_celestial, sun_over
from polarsim.render.views.options import LunarSuns, NearLamps, RoverLight, Suns, Views

log = logging.getLogger("polarsim.render")


@dataclass(frozen=True)
class Light:
    """One lamp of a picture, where it stands in the sky, and how the sky of stars lies over the sandbox."""

    name: str
    lamp: Lamp
    azimuth_deg: float  # from +X towards +Y
    elevation_deg: float
    moment_utc: str  # empty where the file names none
    sandbox_from_celestial: np.ndarray  # (3, 3) rotation


def lights_of(views: Views) -> list[Light]:
    """All lights in the order of the file, names numbered on within each name; moments of lunar night are left out.

    Raises
    ------
    ConfigError
        All moments are night.
    """
    numbers: dict[str, int] = {}
    found = []
    for section in views.lights:
        for lamp, azimuth, elevation, moment, sky in _LAMPS[type(section)](section):
            number = numbers[section.name] = numbers.get(section.name, -1) + 1
            name = f"{section.name}-{number:03d}"
            if name.startswith(f"{ROVER}-"):
                raise ConfigError(f"lights: name {section.name!r} is that of the rover light")
            found.append(Light(name, lamp, azimuth, elevation, moment, sky))
    if not found:
        raise ConfigError("lights: the Sun is down at all moments")
    return found


def rover_lamp(light: RoverLight, camera: NamedCamera) -> Lamp:
    """The rover's light beside a camera; both cameras of a pair share one."""
    left_from_sandbox = camera.left_from_camera @ camera.world_from_camera.inverse()
    return Lamp(left_from_sandbox.inverse().apply(np.array(light.from_camera_m)), light.intensity)


Found = tuple[Lamp, float, float, str, np.ndarray]


def _near(section: NearLamps) -> Iterator[Found]:
    for azimuth, elevation in product(section.azimuth_deg, section.elevation_deg):
        towards = Lamp.sun(azimuth, elevation).position
        place = np.array(section.centre_m) + section.distance_m * towards / np.linalg.norm(towards)
        yield Lamp(place, section.intensity, section.radius_m), azimuth, elevation, "", np.eye(3)


def _suns(section: Suns) -> Iterator[Found]:
    for azimuth, elevation in product(section.azimuth_deg, section.elevation_deg):
        yield Lamp.sun(azimuth, elevation, section.intensity), azimuth, elevation, "", np.eye(3)


def _lunar(section: LunarSuns) -> Iterator[Found]:
    place = (section.latitude_deg, section.longitude_deg)
    sandbox_from_local = _turned(section.north_deg - 90)  # local: x east, y north, z up
    for number in range(section.number):
        moment = section.start_utc + timedelta(hours=number * section.every_h)
        told = moment.strftime("%Y-%m-%dT%H:%M:%SZ")
        compass, elevation = sun_over(*place, moment)
        if elevation < -SUN_RADIUS_DEG:
            log.warning("%s, %s: left out, the Sun is %.1f deg below the horizon", section.name, told, -elevation)
            continue
        azimuth = (section.north_deg - compass) % 360
        sky = sandbox_from_local @ local_from_celestial(*place, moment)
        yield Lamp.sun(azimuth, elevation, section.intensity), azimuth, elevation, told, sky


def _turned(angle_deg: float) -> np.ndarray:
    return Pose.from_rotvec(np.array([0, 0, np.radians(angle_deg)]), np.zeros(3)).rotation


_LAMPS: dict[type, Callable[..., Iterator[Found]]] = {NearLamps: _near, Suns: _suns, LunarSuns: _lunar}
