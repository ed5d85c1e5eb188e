"""Direction of the Sun and orientation of the stars at a site on the Moon at a given time.

Accurate to a few hundredths of a degree from 1900 to 2100, a tenth of the diameter of the Sun. No ephemeris file is
needed.
"""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

import numpy as np

J2000 = datetime(2000, 1, 1, 12, tzinfo=UTC)
_TT_MINUS_UTC_DAYS = 69.2 / 86400  # current value; one minute moves the Sun at the Moon by 0.01 degrees
_CENTURY = 36525.0  # days
_ABERRATION_DEG = 0.00569  # the apparent Sun is delayed by 8.3 minutes
_PRECESSION_DEG = 1.39697  # of the equinox in a century
_OBLIQUITY_DEG = 23.43929  # of the ecliptic of J2000
_MOON_DISTANCE_AU = 385_000.6 / 149_597_870.7

# The Moon's rotation (Archinal et al. 2018, Celest. Mech. Dyn. Astr. 130:22, table 2): arguments E1 to E13, degrees
# and degrees a day; amplitudes, degrees, of the pole's right ascension (sin), declination (cos), meridian (sin).
_ARGUMENTS_DEG = np.array([
    125.045, 250.089, 260.008, 176.625, 357.529, 311.589, 134.963, 276.617, 34.226, 15.134, 119.743, 239.961, 25.053,
])  # fmt: skip
_RATES_DEG = np.array([
    -0.0529921, -0.1059842, 13.0120009, 13.3407154, 0.9856003, 26.4057084, 13.0649930, 0.3287146, 1.7484877, -0.1589763,
    0.0036096, 0.1643573, 12.9590088,
])  # fmt: skip
_ASCENSION_DEG = np.array([-3.8787, -0.1204, 0.0700, -0.0172, 0, 0.0072, 0, 0, 0, -0.0052, 0, 0, 0.0043])
_DECLINATION_DEG = np.array([1.5419, 0.0239, -0.0278, 0.0068, 0, -0.0029, 0.0009, 0, 0, 0.0008, 0, 0, -0.0009])
_MERIDIAN_DEG = np.array([
    3.5610, 0.1208, -0.0642, 0.0158, 0.0252, -0.0066, -0.0047, -0.0046, 0.0028, 0.0052, 0.0040, 0.0019, -0.0044,
])  # fmt: skip


def days_since_j2000(moment: datetime) -> float:
    """Days of terrestrial time since 2000-01-01 12:00."""
    return (moment - J2000).total_seconds() / 86400 + _TT_MINUS_UTC_DAYS


def moon_from_celestial(days: float) -> np.ndarray:
    """Return the rotation (3, 3) from the J2000 equatorial to the lunar frame (z: north pole, x: longitude 0)."""
    arguments = np.radians(_ARGUMENTS_DEG + _RATES_DEG * days)
    sines, cosines, centuries = np.sin(arguments), np.cos(arguments), days / _CENTURY
    ascension = _radians(269.9949 + 0.0031 * centuries + _ASCENSION_DEG @ sines)
    declination = _radians(66.5392 + 0.0130 * centuries + _DECLINATION_DEG @ cosines)
    meridian = _radians(38.3213 + 13.17635815 * days - 1.4e-12 * days**2 + _MERIDIAN_DEG @ sines)
    return _about_z(meridian) @ _about_x(np.pi / 2 - declination) @ _about_z(np.pi / 2 + ascension)


def sun_seen_from_moon(days: float) -> np.ndarray:
    """Return the unit vector (3,) from the Moon to the Sun in the J2000 equatorial frame.

    The position of the Sun follows Meeus, Astronomical Algorithms (1998), chapter 25, to 0.01 degrees. The position of
    the Moon, with an effect of at most 0.15 degrees, uses the largest terms of chapter 47.
    """
    t = days / _CENTURY
    sun_anomaly = np.radians(357.52911 + 35999.05029 * t)
    centre = (
        (1.914602 - 0.004817 * t) * np.sin(sun_anomaly)
        + 0.019993 * np.sin(2 * sun_anomaly)
        + 0.000289 * np.sin(3 * sun_anomaly)
    )
    sun_longitude = np.radians(280.46646 + 36000.76983 * t + centre - _ABERRATION_DEG)
    eccentricity = 0.016708634 - 0.000042037 * t
    distance = 1.000001018 * (1 - eccentricity**2) / (1 + eccentricity * np.cos(sun_anomaly + np.radians(centre)))
    moon = np.radians(218.3164 + 481267.8812 * t)
    elongation, anomaly = np.radians(297.8502 + 445267.1114 * t), np.radians(134.9634 + 477198.8675 * t)
    node_distance = np.radians(93.2721 + 483202.0175 * t)
    moon += np.radians(
        6.289 * np.sin(anomaly)
        + 1.274 * np.sin(2 * elongation - anomaly)
        + 0.658 * np.sin(2 * elongation)
        + 0.214 * np.sin(2 * anomaly)
        - 0.185 * np.sin(sun_anomaly)
    )
    latitude = np.radians(5.128 * np.sin(node_distance))
    of_date = distance * on_sphere(sun_longitude, 0.0) - _MOON_DISTANCE_AU * on_sphere(moon, latitude)
    towards = _about_x(-np.radians(_OBLIQUITY_DEG)) @ _about_z(np.radians(_PRECESSION_DEG * t)) @ of_date
    return towards / np.linalg.norm(towards)


def local_from_celestial(latitude_deg: float, longitude_deg: float, moment: datetime) -> np.ndarray:
    """Return the rotation (3, 3) from the J2000 equatorial frame to east, north and up at a site."""
    latitude, longitude = np.radians([latitude_deg, longitude_deg])
    east = [-np.sin(longitude), np.cos(longitude), 0]
    up = on_sphere(longitude, latitude)
    local_from_moon = np.stack([east, np.cross(up, east), up])
    return np.asarray(local_from_moon @ moon_from_celestial(days_since_j2000(moment)))


def sun_over(latitude_deg: float, longitude_deg: float, moment: datetime) -> tuple[float, float]:
    """Return the azimuth of the Sun from north over east, 0 to 360, and the elevation, degrees."""
    towards = sun_seen_from_moon(days_since_j2000(moment))
    east, north, up = local_from_celestial(latitude_deg, longitude_deg, moment) @ towards
    return float(np.degrees(np.arctan2(east, north)) % 360), float(np.degrees(np.arcsin(up)))


def _radians(angle_deg: Any) -> float:
    return float(np.radians(angle_deg))


def on_sphere(longitude: Any, latitude: Any) -> np.ndarray:
    """Return unit vectors (..., 3) to longitudes and latitudes (...), or right ascensions and declinations, radians."""
    level = np.cos(latitude)
    return np.stack([level * np.cos(longitude), level * np.sin(longitude), np.sin(latitude)], axis=-1)


def _about_z(angle: float) -> np.ndarray:
    """Return the matrix of vector components in axes rotated by an angle about z."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])


def _about_x(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0], [0, c, s], [0, -s, c]])
