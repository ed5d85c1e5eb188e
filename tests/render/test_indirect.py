from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.geometry.camera import Camera
from polarsim.geometry.poses import Pose, camera_pose
from polarsim.photo import BLACK_LEVEL
from polarsim.render.hits import Hits, cast_strip
from polarsim.render.indirect import scattered
from polarsim.render.lamps import REFERENCE_DISTANCE, Lamp
from polarsim.render.olat import render_view
from polarsim.render.options import CHRONO, RenderOptions
from polarsim.render.parameters import LambertParameters, Material
from polarsim.render.scene import Scene, Shot
from polarsim.render.surfaces import Surfaces, build_surfaces
from polarsim.run_files.instances import BACKGROUND, GROUND
from polarsim.run_files.walls import level_walls, write_walls

from .conftest import walled

RADIUS, ALBEDO = 2.0, 0.5  # of the integrating sphere
LAMP = Lamp(np.array([3.0, 0.0, 1.0]))  # low, so that the block casts a long shadow
TRACED = RenderOptions(walls=False, falloff=True, bounces=1, bounce_rays=32, bounce_scale=1)


def sphere():
    """Return a sphere with inward normals."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=4)
    ids = np.full(len(ball.faces), GROUND, np.int32)
    return Surfaces(RADIUS * ball.vertices, ball.faces[:, ::-1], -ball.vertices, ids)


def traced(surfaces, pose, lens, options, model="lambert", lamp=LAMP, threads=1):
    return render_view(surfaces, Camera(pose, lens), {"lamp": lamp}, [model], None, options, threads)


def shadow(above, lens):
    """Return row and column of a pixel in the shadow of the block."""
    column, row = np.floor(lens.project(above.inverse().apply(np.array([-0.4, 0.0, 0.0])))).astype(int)
    return row, column


@pytest.mark.parametrize("bounces", [1, 3])
def test_each_bounce_in_an_integrating_sphere_is_scaled_by_the_albedo(lens, bounces):
    lambert = LambertParameters(albedo=ALBEDO)
    options = TRACED.model_copy(update={"bounces": bounces, "bounce_rays": 32}).with_default(lambert=lambert)
    pose = camera_pose(np.array([0.3, 0.2, 0.1]), 0.5, 0.2)
    view = traced(sphere(), pose, lens.scaled(0.25), options, lamp=Lamp(np.zeros(3)))
    direct = ALBEDO / np.pi * REFERENCE_DISTANCE**2 / RADIUS**2
    assert view.olat_images["lambert", "lamp"].mean() == pytest.approx(direct, rel=0.01)  # the sphere has flat facets
    expected = direct * sum(ALBEDO**k for k in range(1, bounces + 1))  # Goebel, Appl. Opt. 6 (1967) 125
    assert view.indirect["lambert", "lamp"].mean() == pytest.approx(expected, rel=0.01)


def test_the_sign_of_zeros_in_the_pose_has_no_effect(lens):
    pose = Pose(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.1, 1.0]))
    flipped = Pose(*(np.where(part == 0, -part, part) for part in (pose.rotation, pose.translation)))
    assert flipped.matrix.tobytes() != pose.matrix.tobytes()
    options = TRACED.model_copy(update={"bounce_rays": 4})
    one, other = (traced(sphere(), each, lens.scaled(0.5), options) for each in (pose, flipped))
    np.testing.assert_array_equal(one.indirect["lambert", "lamp"], other.indirect["lambert", "lamp"])


@given(st.tuples(*3 * [st.floats(-1, 1)]).filter(lambda v: np.linalg.norm(v) > 0.1))
def test_the_cosine_over_any_hemisphere_integrates_to_pi(direction):
    normal = np.tile((np.array(direction) / np.linalg.norm(direction)).astype(np.float32), (10_000, 1))
    number = np.arange(10_000)
    hits = Hits(slice(0, 1), number, number, 0 * normal, normal, normal, normal, 0 * normal[:, :2])
    even = np.stack(np.meshgrid(*2 * [(np.arange(100) + 0.5) / 100]), axis=-1).reshape(-1, 2).astype(np.float32)
    away, weight = scattered(hits, even)
    np.testing.assert_allclose(np.linalg.norm(away, axis=1), 1, atol=1e-5)
    cosine = (away * normal).sum(axis=1)
    assert (cosine[weight > 0] > 0).all()
    assert weight.mean() == pytest.approx(np.pi, rel=0.01)
    assert (weight * cosine).mean() == pytest.approx(2 * np.pi / 3, rel=0.01)  # integral of the squared cosine


def test_a_level_plane_has_no_indirect_light(blocks, above, lens):
    view = traced(build_surfaces(blocks((), ()), TRACED), above, lens, TRACED)
    assert (view.olat_images["lambert", "lamp"] > 0).any()
    assert not view.indirect["lambert", "lamp"].any()


def test_the_shadow_of_a_lit_block_side_gets_light_from_walls(blocks, above, lens):
    options = TRACED.model_copy(update={"walls": True})
    position = shadow(above, lens)
    dark, pale = (
        traced(
            build_surfaces(walled(blocks(), 1.3), options),
            above,
            lens,
            options.model_copy(update={"wall_albedo": albedo}),
        )
        for albedo in (0.1, 0.8)
    )
    assert dark.olat_images["lambert", "lamp"][position] == 0
    assert pale.whole["lambert", "lamp"][position] > 3 * dark.whole["lambert", "lamp"][position] > 0


def test_the_wall_albedo_affects_only_the_walls(blocks, camera, lens):
    options = RenderOptions(bounce=0, ambient=0.01)
    surfaces = build_surfaces(walled(blocks(), 1.3), options)
    hits = cast_strip(surfaces, Camera(camera, lens), slice(0, lens.height))
    wall = hits.pixel[surfaces.id_of_face[hits.face] == BACKGROUND]
    sand = hits.pixel[surfaces.id_of_face[hits.face] != BACKGROUND]
    own, plain, as_lambert = (
        traced(surfaces, camera, lens, options.model_copy(update=changes), model).olat_images[model, "lamp"].ravel()
        for model, changes in (
            ("hapke", {}),
            ("hapke", {"wall_albedo": 0.6}),
            ("lambert", {"materials": {"default": Material(lambert=LambertParameters(albedo=0.6))}}),
        )
    )
    np.testing.assert_allclose(plain[wall], as_lambert[wall], rtol=1e-5)
    np.testing.assert_array_equal(plain[sand], own[sand])
    assert (plain[wall] > own[wall]).any()


def test_traced_and_constant_ambient_light_agree_on_a_plane(blocks, above, lens):
    bare = build_surfaces(blocks((), ()), TRACED)
    below = Lamp(np.array([0.0, 0.0, -3.0]))  # contributes no direct light
    options = TRACED.model_copy(update={"ambient": 0.2, "bounce": 0.0, "bounces": 0})
    plain = traced(bare, above, lens, options, lamp=below).whole["lambert", "lamp"]
    options = options.model_copy(update={"bounces": 2})
    view = traced(bare, above, lens, options, lamp=below)
    seen = plain > 0
    np.testing.assert_allclose(plain[seen], 0.2 * options.parameters("lambert").albedo / np.pi, rtol=1e-5)
    assert view.whole["lambert", "lamp"][seen].mean() == pytest.approx(float(plain[seen].mean()), rel=0.01)


def test_ambient_light_in_a_closed_sphere_is_scaled_by_every_bounce(lens):
    lambert = LambertParameters(albedo=ALBEDO)
    options = TRACED.model_copy(update={"ambient": 0.2, "bounces": 2, "bounce_rays": 32}).with_default(lambert=lambert)
    outside = Lamp(np.array([0.0, 0.0, 3 * RADIUS]))
    view = traced(sphere(), camera_pose(np.zeros(3), 0.5, 0.2), lens.scaled(0.25), options, lamp=outside)
    expected = 0.2 / np.pi * ALBEDO**3
    assert view.whole["lambert", "lamp"].mean() == pytest.approx(expected, rel=0.01)


def test_coarse_and_exact_indirect_light_agree(blocks, camera, lens):
    options = TRACED.model_copy(update={"walls": True, "wall_albedo": 0.6, "bounce_rays": 48})
    surfaces = build_surfaces(walled(blocks(), 1.3), options)
    exact, coarse = (
        traced(surfaces, camera, lens, options.model_copy(update=changes)).indirect["lambert", "lamp"]
        for changes in ({}, {"bounce_rays": 256, "bounce_scale": 4})
    )
    assert coarse.mean() == pytest.approx(exact.mean(), rel=0.02)
    exact, coarse = (picture.reshape(7, 20, 10, 20).mean(axis=(1, 3)) for picture in (exact, coarse))
    bright = exact > 0.3 * exact.max()
    assert np.median(np.abs(coarse / np.maximum(exact, 1e-9) - 1)[bright]) < 0.03


@pytest.mark.parametrize("scale", [1, 4])
def test_indirect_light_depends_on_the_seed_and_not_on_threads(surfaces, camera, lens, scale):
    options = TRACED.model_copy(update={"bounce_scale": scale, "bounce_rays": 8})
    one, two = (traced(surfaces, camera, lens, options, "hapke", threads=n).indirect["hapke", "lamp"] for n in (1, 2))
    np.testing.assert_array_equal(one, two)
    assert one.any()
    other = traced(surfaces, camera, lens, options.model_copy(update={"seed": 1}), "hapke").indirect["hapke", "lamp"]
    assert (other != one).any()


def test_models_and_lamps_are_independent(surfaces, camera, lens):
    lamps = {"one": LAMP, "half": replace(LAMP, intensity=0.5)}
    both = render_view(surfaces, Camera(camera, lens), lamps, ["hapke", "lambert"], None, TRACED).indirect
    alone = traced(surfaces, camera, lens, TRACED).indirect["lambert", "lamp"]
    np.testing.assert_allclose(both["lambert", "one"], alone, rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(both["hapke", "half"], both["hapke", "one"] / 2, rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("model", CHRONO)
def test_chronos_models_have_no_indirect_light(surfaces, camera, lens, model):
    view = traced(surfaces, camera, lens, TRACED.model_copy(update={"ambient": 0.1}), model)
    assert not view.indirect
    plain = traced(surfaces, camera, lens, TRACED.model_copy(update={"bounces": 0, "bounce": 0.0}), model)
    np.testing.assert_array_equal(view.whole[model, "lamp"], plain.whole[model, "lamp"])


def test_traced_light_replaces_the_constant_light(folders, above, lens):
    shot = Shot(Camera(above, lens), {"mine": LAMP}, 4000.0, "lambert")
    position = shadow(above, lens)
    write_walls(folders / "meshes", level_walls(1.3, 0.28))
    options = RenderOptions(wall_albedo=0.6, bounce_scale=1, bounce_rays=16)
    constant, traced_light, off = (
        Scene(folders / "meshes", 1, options.model_copy(update=changes)).picture(shot)
        for changes in ({"bounce": 0.05}, {"bounce": 0.05, "bounces": 1}, {"bounce": 0.0})
    )
    assert off[position] == BLACK_LEVEL
    assert constant[position] > traced_light[position] > BLACK_LEVEL
