"""Headlights: radiated power, direction, and visibility."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.geometry.poses import Pose
from polarsim.render.olat import NO_LAMP
from polarsim.rover.cameras.bodywork import body_of
from polarsim.rover.cameras.lights import SUN_IN_BAND_W_M2, headlights, named_sun
from polarsim.rover.cameras.options import CameraSuiteOptions
from polarsim.rover.cameras.suite import CameraSuite
from polarsim.rover.vehicle.camera_names import FRONT
from polarsim.rover.vehicle.table import LightPart
from polarsim.run_files.instances import GROUND, ROCK_IDS, SHADOW_IDS
from tests.rover import driven

FORE = ("hazlight_fore_port", "hazlight_fore_starboard")
SMALL = {"views": (FRONT,), "scale": 0.1, "finer": 1, "models": ("hapke",), "stars": "none"}


def light(**changes):
    return LightPart(**{"name": "lamp", "position_m": (0, 0, 0), "beam_deg": 90, "power_w": 12, **changes})


@given(beam_deg=st.floats(5, 170), power_w=st.floats(0.1, 500), radius=st.floats(0.5, 20))
def test_the_flux_through_any_sphere_is_the_radiated_power(beam_deg, power_w, radius):
    here = {"base_link": Pose.identity()}
    lamp = headlights([light(beam_deg=beam_deg, power_w=power_w, yaw_deg=90)], here)["lamp"]
    off = np.radians(np.linspace(0, 90, 20_001))
    points = radius * np.stack([np.zeros_like(off), np.cos(off), np.sin(off)], axis=1)  # about +y
    _, irradiance = lamp.light_at(points, falloff=True)
    through = np.trapezoid(irradiance * 2 * np.pi * radius**2 * np.sin(off), off) * SUN_IN_BAND_W_M2
    assert through == pytest.approx(power_w, rel=1e-4)


@given(beam_deg=st.floats(5, 170), yaw_deg=st.floats(-180, 180), pitch_deg=st.floats(-90, 90))
def test_light_is_half_at_half_the_beam_angle_and_zero_behind(beam_deg, yaw_deg, pitch_deg):
    part = light(beam_deg=beam_deg, yaw_deg=yaw_deg, pitch_deg=pitch_deg, position_m=(0.5, -0.2, 1.0))
    lamp = headlights([part], {"base_link": Pose.identity()})["lamp"]
    yaw, pitch = np.radians([yaw_deg, pitch_deg])  # down is positive
    axis = np.array([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), -np.sin(pitch)])
    np.testing.assert_allclose(lamp.axis, axis, atol=1e-12)
    across = np.cross(axis, [0.3, 0.5, 0.8])
    across /= np.linalg.norm(across)
    half = np.radians(beam_deg / 2)
    towards = np.stack([axis, np.cos(half) * axis + np.sin(half) * across, -axis])
    to_lamp, irradiance = lamp.light_at(np.add(part.position_m, 3 * towards), falloff=True)
    np.testing.assert_allclose(to_lamp, -3 * towards, atol=1e-12)
    np.testing.assert_allclose(irradiance / irradiance[0], [1, 0.5, 0], atol=1e-9)


def test_no_light_of_the_table_is_inside_the_body():
    vehicle = driven.vehicle()
    body = body_of(vehicle)
    for part in vehicle.lights:
        position = np.array(part.position_m)
        for solid in body.solids:
            if solid.link == part.link:
                low, high = solid.vertices.min(axis=0), solid.vertices.max(axis=0)
                assert not ((low < position) & (position < high)).all(), part.name


@pytest.fixture(scope="module")
def drive():
    return driven.trace(seconds=1.0)


def rendered(drive, vehicle=None, **changes):
    """Render the front camera under Sun 1, behind the rover, by default."""
    options = CameraSuiteOptions(**{**SMALL, "suns": ("1",), **changes})
    suite = CameraSuite(drive, vehicle or driven.vehicle(), options)
    suite.show(3)
    return suite.render(FRONT, options.suns)


@pytest.fixture(scope="module")
def sun(drive):
    return rendered(drive)


@pytest.fixture(scope="module")
def both(drive):
    return rendered(drive, suns=("1", "night"), lights=FORE)


def test_light_of_sun_and_rover_adds_up(sun, both):
    np.testing.assert_allclose(
        both.olat_images["hapke", "1"], sun.olat_images["hapke", "1"] + both.olat_images["hapke", "night"], atol=1e-6
    )
    np.testing.assert_array_equal(both.ids["1"], sun.ids["1"])


def test_a_light_may_have_the_name_of_a_sun(drive):
    vehicle = driven.vehicle()
    lights = tuple(part.model_copy(update={"name": "1"}) if part.name == FORE[0] else part for part in vehicle.lights)
    named = rendered(drive, vehicle.model_copy(update={"lights": lights}), lights=("1",))
    as_before = rendered(drive, lights=FORE[:1])
    np.testing.assert_array_equal(named.olat_images["hapke", "1"], as_before.olat_images["hapke", "1"])
    np.testing.assert_array_equal(named.ids["1"], as_before.ids["1"])


def test_headlights_illuminate_the_rovers_shadow(sun, both):
    dark = (sun.ids[NO_LAMP] == GROUND) & (sun.olat_images["hapke", "1"] == 0)
    assert dark.mean() > 0.1
    assert (both.olat_images["hapke", "1"][dark] > 0).mean() > 0.5


def test_at_night_there_are_labels_of_rocks_but_not_of_shadows(both):
    ids = both.ids["night"]
    assert (ids >= ROCK_IDS).any()
    assert not (ids >= SHADOW_IDS).any()
    assert (both.olat_images["hapke", "night"][ids == GROUND] > 0).mean() > 0.5


def test_the_papers_suns_are_in_the_east_southeast_southwest_and_west():
    towards = [named_sun(name, 8.0).position for name in "1234"]
    azimuth = [np.degrees(np.arctan2(y, x)).round(6) % 360 for x, y, _ in towards]
    assert azimuth == [0, 315, 225, 180]
    np.testing.assert_allclose(np.degrees(np.arcsin(towards[0][2] / np.linalg.norm(towards[0]))), 8)
    assert named_sun("night", 8.0) is None
