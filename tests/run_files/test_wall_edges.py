"""Shadow edges of walls in synthetic photos of level sand."""

from dataclasses import replace

import numpy as np
import pytest

from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.poses import camera_pose
from polarsim.run_files.wall_edges import SIDES, OpenGround, disc_radius, edge_profiles
from polarsim.run_files.walls import level_walls
from polarsim.site import Site, polar, site_of
from tests.support.polar_survey import SUN_LAMPS
from tests.support.wall_photos import LAMP_RADIUS, level_sand, shaded_sand

CAMERA = Camera(
    camera_pose(np.array([3.5, -0.3, 1.5]), np.pi, np.radians(25)),
    Lens(420.0, 420.0, 320.0, 240.0, (0, 0, 0, 0, 0), width=640, height=480),
)
WALLS = level_walls(2.0, 0.3, "scans")


def scene(*rocks: Mesh) -> OpenGround:
    return OpenGround.of(level_sand(*rocks))


@pytest.fixture(scope="module")
def photo_of_30():
    return shaded_sand(CAMERA, WALLS, SUN_LAMPS["30"])


def test_the_predicted_edge_is_the_half_light_point_of_the_photo(photo_of_30):
    samples = edge_profiles(scene(), WALLS, SUN_LAMPS["30"], LAMP_RADIUS).measure(photo_of_30, CAMERA)
    assert len(samples) >= 5
    assert {SIDES[number] for number in samples.side} == {"+x"}
    assert np.median(np.abs(samples.offset_m)) < 0.004
    assert np.median(samples.offset_px) < 1


@pytest.mark.parametrize(("face", "top"), [(2.0, 0.27), (2.06, 0.3), (1.97, 0.28)])
def test_measured_points_do_not_depend_on_the_assumed_walls(photo_of_30, face, top):
    lamp, assumed = SUN_LAMPS["30"], level_walls(face, top)
    samples = edge_profiles(scene(), assumed, lamp, LAMP_RADIUS).measure(photo_of_30, CAMERA)
    np.testing.assert_allclose(np.median(WALLS.clearance(samples.measured, lamp)), 0, atol=0.0015)
    # The edges are at lamp - (lamp - face) height / (height - top), by similar triangles; profiles follow the light.
    edge, expected = (lamp[0] - (lamp[0] - x) * lamp[2] / (lamp[2] - z) for x, z in ((2.0, 0.3), (face, top)))
    np.testing.assert_allclose(np.median(samples.measured[:, 0]), edge, atol=0.006)
    light = (samples.measured - lamp)[:, :2]
    along = -light[:, 0] / np.linalg.norm(light, axis=1)
    np.testing.assert_allclose(np.median(samples.offset_m * along), expected - edge, atol=0.006)


def test_profiles_under_a_rock_and_in_its_shadow_are_omitted(photo_of_30):
    lamp = SUN_LAMPS["30"]
    without = edge_profiles(scene(), WALLS, lamp, LAMP_RADIUS).measure(photo_of_30, CAMERA)
    box = np.array([[x, y, z] for x in (0.9, 1.2) for y in (-0.6, 0.9) for z in (0.0, 0.25)])
    quads = ([0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3])
    rock = Mesh(box, np.array([face for a, b, c, d in quads for face in ([a, b, c], [a, c, d])]))
    samples = edge_profiles(scene(rock), WALLS, lamp, LAMP_RADIUS).measure(photo_of_30, CAMERA)
    assert 0 < len(samples) < len(without)
    assert ((samples.measured[:, 1] < -0.6) | (samples.measured[:, 1] > 0.9)).all()


def test_a_photo_without_the_edge_has_no_samples(photo_of_30):
    profiles = edge_profiles(scene(), WALLS, SUN_LAMPS["30"], LAMP_RADIUS)
    assert len(profiles.measure(np.ones_like(photo_of_30), CAMERA)) == 0
    assert len(profiles.measure(shaded_sand(CAMERA, WALLS, SUN_LAMPS["180"]), CAMERA)) == 0
    away = replace(CAMERA, world_from_camera=camera_pose(np.array([3.5, -0.3, 1.5]), 0.0, 0.4))
    assert len(profiles.measure(photo_of_30, away)) == 0


def test_a_lamp_inside_the_walls_has_no_profiles():
    assert len(edge_profiles(scene(), WALLS, np.array([0.3, 0.2, 0.9]), LAMP_RADIUS).side) == 0


def test_penumbrae_follow_the_radius_of_the_lamp_in_the_site():
    lamp = SUN_LAMPS["30"]
    lamps = {"30": {"radius_m": 3 * LAMP_RADIUS}}
    larger = Site.model_validate(site_of({"base": "polar", "lamps": lamps}))
    usual, wide = (edge_profiles(scene(), WALLS, lamp, disc_radius(lamp, site, "30")) for site in (polar(), larger))
    np.testing.assert_allclose(wide.penumbra, 3 * usual.penumbra)
    assert disc_radius(1000 * lamp, larger, "30") == disc_radius(1000 * lamp, polar(), "30")  # parallel light
