"""The Sun over the Moon, against published positions of the Sun."""

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from polarsim.render.views.moon import (
    J2000,
    days_since_j2000,
    local_from_celestial,
    moon_from_celestial,
    sun_over,
    sun_seen_from_moon,
)

MOMENTS = st.datetimes(datetime(1950, 1, 1), datetime(2099, 1, 1)).map(lambda moment: moment.replace(tzinfo=UTC))


def subsolar_point(moment):
    """Return selenographic longitude (-180 to 180, east positive) and latitude of the subsolar point, degrees."""
    days = days_since_j2000(moment)
    x, y, z = moon_from_celestial(days) @ sun_seen_from_moon(days)
    return np.degrees(np.arctan2(y, x)), np.degrees(np.arcsin(z))


def test_the_subsolar_point_is_that_of_meeus_worked_example():
    """Astronomical Algorithms, example 53.a: 1992 April 12, 0h terrestrial time."""
    moment = datetime(1992, 4, 12, tzinfo=UTC) - timedelta(seconds=69.2)
    np.testing.assert_allclose(subsolar_point(moment), (67.89, 1.46), atol=0.015)


@pytest.mark.parametrize(
    ("longitude", "latitude", "moment", "elevation", "azimuth"),
    [
        (23.4333, 0.6875, "1969-07-20T20:17:39", 10.65, 88.81),  # Apollo 11 lands
        (23.4333, 0.6875, "1969-07-21T17:54:00", 21.65, 88.91),
        (-23.3856, -3.1975, "1969-11-19T06:54:36", 5.19, 91.16),  # Apollo 12
        (-23.3856, -3.1975, "1969-11-20T14:25:47", 21.11, 90.33),
    ],
)
def test_the_sun_over_the_apollo_sites_agrees_with_the_surface_journal(longitude, latitude, moment, elevation, azimuth):
    """Apollo Lunar Surface Journal, "Sun and Earth: Altitudes and Azimuths", computed by Scotti."""
    found = sun_over(latitude, longitude, datetime.fromisoformat(moment + "+00:00"))
    np.testing.assert_allclose(found, (azimuth, elevation), atol=0.03)


def test_the_rotation_of_the_moon_agrees_with_spice():
    """CSPICE's sxform("IAU_MOON", "J2000", 14610 days) with pck00011.tpc."""
    expected = [
        [0.5720547105837333, 0.8198082524397307, -0.025842548842481546],
        [-0.761073769862349, 0.5187960000245592, -0.38938082539594815],
        [-0.30581061030147345, 0.24241522144913360, 0.9207142528946177],
    ]
    np.testing.assert_allclose(moon_from_celestial(14610.0).T, expected, atol=1e-9)


@given(MOMENTS)
def test_the_subsolar_latitude_is_below_1_62_degrees(moment):
    """The Moon's equator is tilted by 1.54 degrees against the ecliptic (Cassini's laws)."""
    assert abs(subsolar_point(moment)[1]) < 1.62


@settings(max_examples=40)
@given(MOMENTS, st.floats(-90, 90), st.floats(-180, 180))
def test_the_elevation_follows_from_the_distance_to_the_subsolar_point(moment, latitude, longitude):
    sun_longitude, sun_latitude = subsolar_point(moment)
    azimuth, elevation = sun_over(latitude, longitude, moment)
    apart = np.radians(longitude - sun_longitude)
    phi, theta = np.radians([latitude, sun_latitude])
    expected = np.sin(phi) * np.sin(theta) + np.cos(phi) * np.cos(theta) * np.cos(apart)
    np.testing.assert_allclose(np.sin(np.radians(elevation)), expected, atol=1e-9)
    east, north, up = local_from_celestial(latitude, longitude, moment) @ sun_seen_from_moon(days_since_j2000(moment))
    level = np.cos(np.radians(elevation))
    told = [level * np.sin(np.radians(azimuth)), level * np.cos(np.radians(azimuth)), np.sin(np.radians(elevation))]
    np.testing.assert_allclose([east, north, up], told, atol=1e-9)


def test_days_count_from_noon_of_the_year_2000():
    assert days_since_j2000(J2000) == pytest.approx(0, abs=1e-3)
    assert days_since_j2000(J2000 + timedelta(days=36525)) == pytest.approx(36525, abs=1e-3)
