import numpy as np
import pytest

from polarsim.geometry.camera import Camera
from polarsim.geometry.poses import camera_pose
from polarsim.render.lamps import REFERENCE_DISTANCE, Lamp
from polarsim.render.optics import lens_flare_of, scattering

VISIBLE = Lamp(np.array([-1.0, 0.2, 0.5]))  # in the image, on the other side of the block


@pytest.fixture
def options(plain):
    return plain.model_copy(update={"lens_flare": 0.01})


def test_scattered_light_integrates_to_1_and_follows_stiles_and_holladay():
    edges = np.linspace(0, np.pi / 2, 200_001)
    centre = (edges[1:] + edges[:-1]) / 2
    rings = 2 * np.pi * (np.cos(edges[:-1]) - np.cos(edges[1:]))
    assert (scattering(centre) * rings).sum() == pytest.approx(1, rel=1e-6)
    degrees = np.array([5.0, 10, 20, 30])
    found = scattering(np.radians(degrees)) * degrees**2 / 10  # over the law, cd/m^2 per lux, from 1 to 30 degrees
    np.testing.assert_allclose(found / found[-1], 1, atol=0.04)


def test_veiling_glare_is_maximal_at_the_lamp(surfaces, camera, lens, options):
    glare = lens_flare_of(surfaces, Camera(camera, lens), VISIBLE, options)
    column, row = np.floor(lens.project(camera.inverse().apply(VISIBLE.position)))
    assert np.unravel_index(glare.argmax(), glare.shape) == (row, column)


def test_a_lamp_outside_the_image_veils_the_adjacent_side(surfaces, camera, lens, options):
    position = camera.apply(np.array([2.0, 0.0, 2.0]))  # 45 degrees to the right; the image ends at 25
    glare = lens_flare_of(surfaces, Camera(camera, lens), Lamp(position), options)
    assert (glare.argmax(axis=1) == lens.width - 1).all()
    assert glare.min() > 0


def test_veiling_glare_is_a_share_of_the_light_on_the_lens(surfaces, lens, options):
    pose = camera_pose(np.array([2.0, 0.0, 1.0]), np.pi, 0.0)
    lamp = Lamp(np.array([-1.0, 0.0, 1.0]), intensity=2.0)  # 3 m ahead
    centre = lens_flare_of(surfaces, Camera(pose, lens), lamp, options)[70, 100]
    angle = np.arctan(np.hypot(0.5, 0.5) / 220)
    light = 2.0 * (REFERENCE_DISTANCE / 3) ** 2
    assert centre == pytest.approx(0.01 * light * scattering(np.array(angle)), rel=1e-3)
    even = options.model_copy(update={"falloff": False})
    assert lens_flare_of(surfaces, Camera(pose, lens), lamp, even)[70, 100] == pytest.approx(
        centre / (4 / 3) ** 2, rel=1e-5
    )


@pytest.mark.parametrize("radius_m", [0.0, 0.02])
def test_hidden_lamps_and_lamps_behind_the_camera_cause_no_glare(surfaces, lens, options, radius_m):
    pose = camera_pose(np.array([1.5, 0.0, 0.1]), np.pi, 0.0)  # level, towards the block, which is 0.2 m high
    hidden, behind = Lamp(np.array([-1.0, 0, 0.1]), 1.0, radius_m), Lamp(np.array([2.0, 0, 0.1]), 1.0, radius_m)
    for lamp in (hidden, behind):
        assert not lens_flare_of(surfaces, Camera(pose, lens), lamp, options).any()
    assert lens_flare_of(surfaces, Camera(pose, lens), Lamp(np.array([-1.0, 0, 0.4]), 1.0, radius_m), options).all()


def test_a_half_hidden_lamp_causes_half_of_the_glare(surfaces, lens, options):
    pose = camera_pose(np.array([1.5, 0.0, 0.2]), np.pi, 0.0)  # level with the block's top
    options = options.model_copy(update={"lamp_samples": 2000, "falloff": False})
    half, whole = (
        lens_flare_of(surfaces, Camera(pose, lens), Lamp(np.array([-1.0, 0, height]), 1.0, 0.05), options).max()
        for height in (0.2, 0.27)
    )
    assert half / whole == pytest.approx(0.5, abs=0.03)
