"""Lamps of a photo (near points or discs) and the Sun of lunar scenes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from polarsim.geometry.light_field import REACH_M, relative_irradiance
from polarsim.geometry.vectors import dot, length
from polarsim.photo import PhotoKey
from polarsim.run_files.rigs import LocalisedRig
from polarsim.site import Site
from polarsim.site_parts import Tripod

ROVER = "rover"  # name of the rover light; Sun lamps are named by their azimuth
REFERENCE_DISTANCE = 4.0  # metres: a lamp of intensity 1 at this distance has irradiance 1, with and without falloff
SUN_DISTANCE = 1e4  # metres: the direction differs by 0.02 degrees between opposite ends of the sandbox
SUN_RADIUS_DEG = 0.2665  # half the Sun's mean apparent diameter


@dataclass(frozen=True)
class Lamp:
    """Lamp with a position (3,) in the sandbox frame, metres, and an intensity relative to a Sun lamp."""

    position: np.ndarray
    intensity: float = 1.0
    radius_m: float = 0.0  # of a disc that faces every lit point
    distant: bool = False  # irradiance does not depend on the distance
    light_field: tuple[float, ...] = ()  # coefficients of `light_field`; measured, replaces the falloff
    field_reach_m: float = REACH_M  # of the light field

    @classmethod
    def sun(cls, azimuth_deg: float, elevation_deg: float, intensity: float = 1.0) -> Lamp:
        """Return the real Sun, 0.53 degrees wide: azimuth from +X towards +Y, elevation above the horizon."""
        azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
        level = np.cos(elevation)
        towards = np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])
        radius = SUN_DISTANCE * float(np.tan(np.radians(SUN_RADIUS_DEG)))
        return cls(SUN_DISTANCE * towards, intensity, radius, distant=True)

    def light_at(self, points: np.ndarray, *, falloff: bool) -> tuple[np.ndarray, np.ndarray]:
        """Return vectors to the lamp (n, 3), metres, and irradiance normal to the beam (n,), at points (n, 3)."""
        to_lamp = np.empty_like(points)
        for axis in range(3):
            np.subtract(points.dtype.type(self.position[axis]), points[:, axis], out=to_lamp[:, axis])
        if self.light_field:
            field = relative_irradiance(self.light_field, points, self.field_reach_m)
            return to_lamp, points.dtype.type(self.intensity) * field
        if self.distant or not falloff:
            return to_lamp, np.full(len(points), self.intensity, points.dtype)
        return to_lamp, self.intensity * REFERENCE_DISTANCE**2 / dot(to_lamp, to_lamp)


@dataclass(frozen=True)
class Spotlight(Lamp):
    """Spotlight along the unit vector `axis` (3,), with half the intensity at `beam_deg` / 2 from the axis.

    The intensity is a power of the cosine of the angle from the axis, as for an LED (Moreno & Sun, Optics Express 16
    (2008) 1808), and 0 in the rear hemisphere.
    """

    axis: np.ndarray = field(default_factory=lambda: np.array([1.0, 0, 0]))
    beam_deg: float = 120.0

    def light_at(self, points: np.ndarray, *, falloff: bool) -> tuple[np.ndarray, np.ndarray]:
        to_lamp, irradiance = super().light_at(points, falloff=falloff)
        along = -dot(to_lamp, np.broadcast_to(self.axis.astype(points.dtype), points.shape)) / length(to_lamp)
        return to_lamp, irradiance * np.maximum(along, 0) ** points.dtype.type(beam_power(self.beam_deg))


def beam_power(beam_deg: float) -> float:
    """Return the exponent with which the cosine is 0.5 at half of the full beam angle."""
    return float(np.log(0.5) / np.log(np.cos(np.radians(beam_deg / 2))))


def field_reach_m(site: Site) -> float:
    """Return the reach of the light fields of a site: the usual one, or half the longer side of a larger sandbox."""
    return max(REACH_M, site.sandbox.reach_m)


def lamp_names(site: Site) -> tuple[str, ...]:
    """Return the names of the Sun lamps in the order of the site, then `ROVER`."""
    return (*site.suns, ROVER)


def lamps_of_rig(
    suns: Mapping[str, np.ndarray], rig: LocalisedRig, site: Site, radius_m: float | None = 0.0
) -> dict[str, Lamp]:
    """Return the Sun lamps by azimuth and the rover light of a rig (a point), if the site has one.

    Sun lamps are discs of the given radius, None: that of the site. Directional lamps are far away and their light does
    not fall off.
    """
    lamps = {
        azimuth: Lamp(
            position,
            radius_m=site.lamps[azimuth].radius_m if radius_m is None else radius_m,
            distant=site.lamps[azimuth].kind == "directional",
        )
        for azimuth, position in suns.items()
    }
    if site.rig_lamp is None:
        return lamps
    return {**lamps, ROVER: Lamp(rig.rover_light(site.rig_lamp), site.rig_lamp.share)}


def lamps_on(key: PhotoKey) -> tuple[str, ...]:
    """Return the names of the lamps that are on in a photo; the first casts the labelled shadows."""
    sun = (key.azimuth,) if key.has_sun else ()
    return (*sun, ROVER) if key.light == "on" else sun


def first_lamp(site: Site) -> Lamp:
    """Return the first Sun lamp of a site; without one, the rig lamp at the first position."""
    if site.lamps:
        lamp = next(iter(site.lamps.values()))
        return Lamp(np.array(lamp.point), distant=lamp.kind == "directional")
    assert site.rig_lamp is not None
    return Lamp(np.array(first_tripod(site).camera_m), site.rig_lamp.share)


def first_tripod(site: Site) -> Tripod:
    """Return the first surveyed position of a site; for a site without any, a view from beyond its +X side."""
    surveyed = [site.tripods[position] for position in site.all_positions if position in site.tripods]
    if surveyed:
        return surveyed[0]
    reach = site.sandbox.reach_m  # POLAR's sandbox would be seen from (3.5, 0, 1.5)
    return Tripod(camera_m=(1.75 * reach, 0.0, 0.75 * reach), yaw_deg=180)
