"""Lamps of novel views."""

import numpy as np
import pytest

from polarsim.errors import ConfigError
from polarsim.render.views.cameras import cameras_of
from polarsim.render.views.moon import days_since_j2000, sun_over, sun_seen_from_moon
from polarsim.render.views.plan import lights_of, rover_lamp
from polarsim.site import polar
from tests.support.polar_survey import RIG_LAMP

LUNAR = {"kind": "lunar_sun", "latitude_deg": 20, "longitude_deg": 30, "start_utc": "2026-05-25T06:00:00Z"}


def test_a_lamp_has_the_given_azimuth_elevation_and_distance(views_of):
    lamp = {"kind": "lamp", "azimuth_deg": [90], "elevation_deg": [30], "distance_m": 4, "centre_m": [1, 0, 0]}
    (light,) = lights_of(views_of(lights=[lamp]))
    np.testing.assert_allclose(light.lamp.position, [1, 4 * np.cos(np.pi / 6), 2], atol=1e-9)


def test_lists_of_angles_are_combined_in_order(views_of):
    sun = {"kind": "sun", "azimuth_deg": [0, 90], "elevation_deg": [5, 10]}
    lights = lights_of(views_of(lights=[sun, sun]))
    assert [(light.azimuth_deg, light.elevation_deg) for light in lights[:4]] == [(0, 5), (0, 10), (90, 5), (90, 10)]
    assert [light.name for light in lights] == [f"sun-{number:03d}" for number in range(8)]


@pytest.mark.parametrize("north_deg", [90, 0, -35.5])
def test_the_lunar_sun_has_the_compass_azimuth(views_of, north_deg):
    (light,) = lights_of(views_of(lights=[{**LUNAR, "north_deg": north_deg}]))
    views = views_of(lights=[LUNAR])
    compass, elevation = sun_over(20, 30, views.lights[0].start_utc)
    towards = light.lamp.position / np.linalg.norm(light.lamp.position)
    north = np.array([np.cos(np.radians(north_deg)), np.sin(np.radians(north_deg)), 0])
    east = np.cross(north, [0, 0, 1])
    level = np.cos(np.radians(elevation))
    np.testing.assert_allclose(towards @ north, level * np.cos(np.radians(compass)), atol=1e-9)
    np.testing.assert_allclose(towards @ east, level * np.sin(np.radians(compass)), atol=1e-9)
    np.testing.assert_allclose(towards[2], np.sin(np.radians(elevation)), atol=1e-9)
    celestial = sun_seen_from_moon(days_since_j2000(views.lights[0].start_utc))
    np.testing.assert_allclose(light.sandbox_from_celestial @ celestial, towards, atol=1e-9)


def test_lunar_nights_are_omitted(views_of, caplog):
    month = {**LUNAR, "number": 30, "every_h": 24}
    lights = lights_of(views_of(lights=[month]))
    assert 13 <= len(lights) <= 16  # half of a lunar day is night
    assert all(light.elevation_deg > -0.27 for light in lights)
    assert len(caplog.records) == 30 - len(lights)


def test_views_with_only_lunar_nights_are_rejected(views_of):
    with pytest.raises(ConfigError):
        lights_of(views_of(lights=[{**LUNAR, "start_utc": "2026-06-10T00:00:00Z"}]))


def test_the_rover_light_moves_with_the_left_camera(views_of):
    views = views_of(stereo=True, rover_light={"states": [True]})
    left, right = cameras_of(views, lambda points: np.zeros(len(points)))
    lamps = [rover_lamp(camera, polar().rig_lamp) for camera in (left, right)]
    expected = left.world_from_camera.apply(np.array(RIG_LAMP.from_camera_m))
    for lamp in lamps:
        np.testing.assert_allclose(lamp.position, expected, atol=1e-12)
