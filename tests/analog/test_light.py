import numpy as np
import pytest

from polarsim.analog.bounce import AMBIENT, gather_bounce
from polarsim.analog.light import DiscLamp, direct, reflect, visibility
from polarsim.analog.sandbox import GROUND_OBJECT
from polarsim.analog.view import lens_directions, make_textures, render_gbuffer
from polarsim.geometry.camera import Camera
from polarsim.geometry.poses import camera_pose
from tests.support.polar_rig import default_rig

BALL_RADIUS, BALL_HEIGHT = 0.15, 0.10  # metres, of the ball that conftest puts into the scene

LAMP = DiscLamp(np.array([0.3, 3.5, 0.9]), np.zeros(3), 0.03)


def upper_directions(rng, count):
    directions = rng.normal(0, 1, (count, 3)).astype(np.float32)
    directions[:, 2] = np.abs(directions[:, 2]) + 0.05
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


@pytest.mark.parametrize("material", range(9))
def test_reflection_is_positive_and_reciprocal(rng, material):
    to_light, to_eye = upper_directions(rng, 500), upper_directions(rng, 500)
    normals = np.tile(np.float32([0, 0, 1]), (500, 1))
    plain = np.full(500, material), np.full(500, 0.3, np.float32), np.full(500, 0.2, np.float32), normals
    forth = reflect(*plain, to_light, to_eye) / to_light[:, 2]
    back = reflect(*plain, to_eye, to_light) / to_eye[:, 2]
    assert (forth > 0).all()
    np.testing.assert_allclose(forth, back, rtol=1e-4)


def test_sand_has_an_opposition_surge_and_conserves_energy(rng):
    normal = np.float32([[0, 0, 1]])
    sand = np.array([0]), np.float32([0.19]), np.float32([0]), normal
    overhead = np.float32([[0.5, 0, np.sqrt(0.75)]])
    away = np.float32([[-0.5, 0, np.sqrt(0.75)]])
    assert reflect(*sand, overhead, overhead)[0] > 1.3 * reflect(*sand, overhead, away)[0]
    out = rng.normal(0, 1, (200_000, 3)).astype(np.float32)
    out[:, 2] = np.abs(out[:, 2])
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    for light in (np.float32([0, 0, 1]), np.float32([0.985, 0, 0.173])):
        many = (np.zeros(len(out), int), np.full(len(out), 0.19, np.float32), np.zeros(len(out), np.float32))
        brdf_cos = reflect(*many, np.broadcast_to(normal, out.shape), np.broadcast_to(light, out.shape), out) / light[2]
        reflected = 2 * np.pi * (brdf_cos * out[:, 2]).mean()
        assert 0.1 < reflected < 0.6  # share of the incident light


def test_irradiance_falls_with_the_square_of_the_distance():
    on_axis = -LAMP.axis[None].astype(np.float32)
    near, far = (LAMP.irradiance(on_axis, np.float32([d]))[0] for d in (2.0, 6.0))
    assert near == pytest.approx(9 * far)
    assert near == pytest.approx(0.25)


def test_interpolated_lens_directions_are_accurate_to_0_003_px():
    lens = default_rig().left
    exact = lens.pixel_directions(slice(None, None, 37), slice(None, None, 41))
    error = lens_directions(lens)[::37, ::41] - exact
    assert np.abs(error * lens.fx).max() < 0.003


def test_pixels_of_a_view_project_back_to_themselves(ball_view, small_lens):
    pose = camera_pose(np.array([3.5, 0.0, 1.5]), np.pi, np.radians(25))
    sand = ball_view.objects == GROUND_OBJECT
    np.testing.assert_allclose(ball_view.points[sand][:, 2], 0, atol=1e-5)
    row, column = np.argwhere(sand)[1000]
    pixel = small_lens.project(pose.inverse().apply(ball_view.points[row, column].astype(float)))
    np.testing.assert_allclose(pixel, [column + 0.5, row + 0.5], atol=0.01)


def test_the_shadow_of_a_ball_agrees_with_geometry(ball_view, ball_caster, rng):
    seen = visibility(ball_view, ball_caster, LAMP, rng)
    sand = (ball_view.objects == GROUND_OBJECT) & (np.abs(ball_view.points[..., :2]).max(axis=-1) < 1)
    to_lamp = LAMP.position - ball_view.points
    to_lamp /= np.linalg.norm(to_lamp, axis=-1, keepdims=True)
    to_ball = np.array([0, 0, BALL_HEIGHT]) - ball_view.points
    along = np.einsum("...k,...k->...", to_ball, to_lamp)
    miss = np.linalg.norm(to_ball - along[..., None] * to_lamp, axis=-1)
    occluded = (along > 0) & (miss < BALL_RADIUS - 0.02)
    clear = (miss > BALL_RADIUS + 0.02) | (along < 0)
    assert (sand & occluded).sum() > 100
    assert seen[sand & occluded].mean() < 0.05
    assert seen[sand & clear].mean() > 0.97


def test_a_wider_lamp_makes_a_softer_shadow(ball_view, ball_caster):
    def half_lit(radius):
        lamp = DiscLamp(LAMP.position, LAMP.target, radius)
        seen = visibility(ball_view, ball_caster, lamp, np.random.default_rng(1))
        sand = (ball_view.objects == GROUND_OBJECT) & (np.abs(ball_view.points[..., :2]).max(axis=-1) < 1)
        return ((seen > 0.2) & (seen < 0.8) & sand).sum()

    assert half_lit(0.15) > 2 * half_lit(0.01)


def test_sand_in_shadow_gets_light_from_walls_and_rocks(ball_scene, ball_caster, ball_view, rng, monkeypatch):
    monkeypatch.setattr("polarsim.analog.bounce._BOUNCE_RAYS", 12)
    bounce = gather_bounce(ball_scene, ball_caster, {"lamp": LAMP}, rng)
    indirect = bounce.at(ball_scene, ball_view, [AMBIENT, "lamp"])["lamp"]
    lit = direct(ball_view, LAMP, visibility(ball_view, ball_caster, LAMP, rng))
    sand = ball_view.objects == GROUND_OBJECT
    assert (indirect[sand] > 0).mean() > 0.99
    assert 0.002 < np.median(indirect[sand]) / np.median(lit[sand]) < 0.3
    assert (bounce.vectors[AMBIENT] != 0).any()


def test_a_view_does_not_depend_on_threads(ball_scene, ball_view, small_lens):
    pose = camera_pose(np.array([3.5, 0.0, 1.5]), np.pi, np.radians(25))
    textures = make_textures(np.random.default_rng(2))
    again = render_gbuffer(ball_scene, ball_scene.caster(threads=2), textures, Camera(pose, small_lens))
    np.testing.assert_array_equal(again.points, ball_view.points)
    np.testing.assert_array_equal(again.albedo, ball_view.albedo)
