"""Stars: positions, brightness, rotation with time, occlusion by the scene."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from polarsim.geometry.camera import Camera
from polarsim.geometry.poses import Pose, camera_pose
from polarsim.render.views.cameras import pinhole
from polarsim.render.views.stars import (
    SUN_MAGNITUDE,
    Sky,
    build_sky,
    sky_images,
    sky_mask,
    star_directions,
    star_radiance,
)

LENS = pinhole(50, 160, 120)
UPWARDS = camera_pose(np.array([0.0, 0, 1]), 0.4, -0.9)


def one_star(pixel, pose=UPWARDS, lens=LENS):
    direction = pose.rotate(lens.directions(np.array(pixel)))
    return Sky(direction[None] / np.linalg.norm(direction), np.ones(1))


def total(radiance, lens=LENS):
    """Return the irradiance of an image: radiance times the solid angle of each pixel."""
    cosine = 1 / np.linalg.norm(lens.pixel_directions(), axis=-1)
    return (radiance * cosine**3).sum() / (lens.fx * lens.fy)


@pytest.mark.parametrize(("magnitude", "number"), [(4, 480), (5, 1471), (6, 4559)])
def test_the_number_of_stars_by_magnitude(magnitude, number):
    sky = build_sky()
    np.testing.assert_allclose(np.linalg.norm(sky.directions, axis=1), 1)
    assert (sky.irradiance > 10 ** (-0.4 * (magnitude - SUN_MAGNITUDE))).sum() == number


# Right ascension, declination (J2000, SIMBAD) and proper motion, mas a year, along both.
@pytest.mark.parametrize(
    ("ra", "dec", "motion"),
    [
        ((18, 36, 56.33635), (38, 47, 1.2802), (200.94, 286.23)),  # Vega
        ((6, 45, 8.91728), (-16, -42, -58.0171), (-546.01, -1223.07)),  # Sirius
        ((2, 31, 49.09456), (89, 15, 50.7923), (44.48, -11.85)),  # Polaris
        ((14, 15, 39.67207), (19, 10, 56.673), (-1093.39, -2000.06)),  # Arcturus
    ],
)
def test_bright_stars_have_their_positions_of_2026(ra, dec, motion):
    """Within 10 seconds of arc, a tenth of a pixel of the POLAR cameras."""
    sexagesimal = np.array([1, 1 / 60, 1 / 3600])
    ra_deg, dec_deg = 15 * np.array(ra) @ sexagesimal, np.array(dec) @ sexagesimal
    dec_now = dec_deg + 26 * motion[1] / 3.6e6
    ra_now = ra_deg + 26 * motion[0] / 3.6e6 / np.cos(np.radians(dec_deg))
    expected = star_directions(np.array([ra_now]), np.array([dec_now]))[0]
    off = np.linalg.norm(build_sky().directions - expected, axis=1).min()
    assert np.degrees(off) < 10 / 3600


def test_intensity_scales_all_stars():
    np.testing.assert_allclose(build_sky(50).irradiance, 50 * build_sky().irradiance)


@pytest.mark.parametrize("pixel", [[80.0, 60.0], [80.5, 60.5], [20.25, 100.9], [150.1, 5.4]])
def test_a_star_is_distributed_over_the_nearest_pixels(pixel):
    radiance = star_radiance(one_star(pixel), np.eye(3), Camera(UPWARDS, LENS))
    rows, columns = np.nonzero(radiance)
    assert len(rows) <= 4
    weights = radiance[rows, columns] / radiance.sum()
    np.testing.assert_allclose([columns @ weights + 0.5, rows @ weights + 0.5], pixel, atol=1e-4)
    np.testing.assert_allclose(total(radiance), 1, rtol=0.02)


def test_stars_rotate_with_the_camera():
    """The pixel of a star follows the rotation of the camera and does not depend on the position."""
    star = one_star([80.5, 60.5])
    rotated = Pose(Rotation.from_rotvec([0, 0, 0.1]).as_matrix() @ UPWARDS.rotation, np.array([5.0, 3, 2]))
    radiance = star_radiance(star, np.eye(3), Camera(rotated, LENS))
    rows, columns = np.nonzero(radiance)
    weights = radiance[rows, columns] / radiance.sum()
    expected = LENS.project(star.directions[0] @ rotated.rotation)
    np.testing.assert_allclose([columns @ weights + 0.5, rows @ weights + 0.5], expected, atol=1e-3)
    assert abs(expected[0] - 80.5) > 5
    moved = Pose(UPWARDS.rotation, np.array([100.0, 0, 0]))
    np.testing.assert_array_equal(
        star_radiance(star, np.eye(3), Camera(moved, LENS)), star_radiance(star, np.eye(3), Camera(UPWARDS, LENS))
    )


def test_the_sky_rotates_with_time():
    rotation = Rotation.from_rotvec([0.2, -0.1, 0.3]).as_matrix()
    sky = build_sky()
    rotated_camera = Pose(rotation.T @ UPWARDS.rotation, UPWARDS.translation)
    np.testing.assert_allclose(
        star_radiance(sky, rotation, Camera(UPWARDS, LENS)),
        star_radiance(sky, np.eye(3), Camera(rotated_camera, LENS)),
        rtol=1e-4,
    )


def test_stars_are_hidden_by_the_scene(surfaces):
    pose = camera_pose(np.array([2.5, -0.3, 1.0]), np.pi, 0.1)
    empty = sky_mask(surfaces, Camera(pose, LENS), 1)
    assert 0.2 < empty.mean() < 0.9
    sky = build_sky()
    olat_images = sky_images(sky, {"one": np.eye(3), "two": np.eye(3)}, surfaces, Camera(pose, LENS), 2)
    assert (olat_images["one"][empty] > 0).any()
    assert not olat_images["one"][~empty].any()
    assert olat_images["one"] is olat_images["two"]


def test_stars_behind_the_camera_are_not_visible():
    backwards = Sky(-one_star([80.0, 60.0]).directions, np.ones(1))
    assert not star_radiance(backwards, np.eye(3), Camera(UPWARDS, LENS)).any()
