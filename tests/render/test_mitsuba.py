"""Reflectance, direct light and indirect light compared with the independent renderer Mitsuba 3."""

import numpy as np
import pytest

from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import camera_pose
from polarsim.photo import NO_ROCK
from polarsim.render import brdf
from polarsim.render.lamps import Lamp
from polarsim.render.olat import render_view
from polarsim.render.options import RenderOptions
from polarsim.render.parameters import PrincipledParameters
from polarsim.render.surfaces import build_surfaces
from polarsim.run_files.scene import TerrainMesh
from tests.support.mitsuba_scene import bsdf, mitsuba_scene, render, variant

from .conftest import walled

mi = pytest.importorskip("mitsuba", reason="mitsuba is not installed: pip install polarsim[mitsuba]")
mi.set_variant(variant())

BLOCK = 16  # pixels
LENS = Lens(150.0, 150.0, 61.0, 45.0, width=128, height=96)  # off-centre, to test the principal point
# Rolled, so that edges of walls are not parallel to pixel rows: four rays per pixel are too few for such edges.
CAMERA = camera_pose(np.array([2.6, -0.3, 1.5]), np.pi, np.radians(30), np.radians(15))
LAMP = Lamp(np.array([1.2, 2.9, 1.4]))
OPTIONS = RenderOptions(
    bounce=0,
    falloff=True,
    samples=4,
    materials={"default": {"lambert": {"albedo": 0.4}}},
    bounce_rays=64,
    bounce_scale=1,
)
# Base colour, roughness, specular, metallic.
SETS = [
    (0.5, 0.5, 0.5, 0),
    (0.2, 0.8, 1.0, 0),
    (0.7, 0.8, 1.0, 0),
    (0.3, 1.0, 0.0, 0),
    (0.8, 0.1, 0.5, 0),
    (0.9, 0.05, 0.2, 0),
    (0.6, 0.4, 0.5, 1),
    (0.6, 0.4, 0.5, 0.5),
]


def sandbox():
    """Return bumpy ground, 4 m wide, with three smooth, half buried rocks."""
    import trimesh

    axis = np.linspace(-2, 2, 81)
    x, y = (a.ravel() for a in np.meshgrid(axis, axis))
    number = np.arange(len(x)).reshape(81, 81)
    quads = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1).reshape(-1, 4)
    vertices = [np.stack([x, y, 0.05 * np.sin(3 * x) * np.cos(4 * y)], axis=1)]
    slopes = [-0.15 * np.cos(3 * x) * np.cos(4 * y), 0.2 * np.sin(3 * x) * np.sin(4 * y), np.ones_like(x)]
    normals, faces = [np.stack(slopes, axis=1)], [np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])]
    rock_of_face = [np.full(len(faces[0]), NO_ROCK)]
    ball = trimesh.creation.icosphere(subdivisions=4)
    points = [(0.0, 0.1, 0.3, 0.25, 0.3), (0.9, -0.6, 0.15, 0.2, 0.14), (-0.8, -0.7, 0.3, 0.2, 0.2)]
    for rock, (left, ahead, *radii) in enumerate(points, 1):
        faces.append(ball.faces + sum(map(len, vertices)))
        vertices.append(ball.vertices * radii + [left, ahead, 0.05])
        normals.append(ball.vertices / radii)
        rock_of_face.append(np.full(len(ball.faces), rock))
    upright = np.concatenate(normals)
    upright /= np.linalg.norm(upright, axis=1, keepdims=True)
    mesh = TerrainMesh(np.concatenate(vertices), np.concatenate(faces), np.concatenate(rock_of_face), upright)
    return walled(mesh, 1.9)


def blocks(picture):
    """Return means over blocks of 16 x 16 pixels."""
    high, wide = picture.shape
    return picture.reshape(high // BLOCK, BLOCK, wide // BLOCK, BLOCK).mean(axis=(1, 3))


def mitsuba_values(parameters, to_lamp, to_viewer):
    """Return f_r cos(i) (n,) for directions (n, 3) above the surface, in the surface frame."""
    plugin = mi.load_dict(bsdf(parameters)["side"])
    values = []
    for lamp, viewer in zip(to_lamp, to_viewer, strict=True):
        position = mi.SurfaceInteraction3f()
        position.wi = viewer
        values.append(np.array(plugin.eval(mi.BSDFContext(), position, mi.Vector3f(lamp))).ravel()[0])
    return np.array(values)


def hemisphere(rng, count):
    """Return random directions with a uniform cosine to +Z between 0 and 1."""
    cosine, angle = 1 - rng.random(count), rng.uniform(0, 2 * np.pi, count)
    level = np.sqrt(1 - cosine**2)
    return np.stack([level * np.cos(angle), level * np.sin(angle), cosine], axis=1)


@pytest.mark.parametrize("values", SETS, ids=str)
def test_the_principled_model_agrees_with_mitsuba(values, scalar):
    base, roughness, specular, metallic = values
    parameters = PrincipledParameters(base_color=base, roughness=roughness, specular=specular, metallic=metallic)
    rng = np.random.default_rng(5)
    to_lamp, to_viewer = hemisphere(rng, 2000), hemisphere(rng, 2000)
    ours = brdf.reflectance(parameters, np.tile([0.0, 0, 1], (2000, 1)), to_lamp, to_viewer) * to_lamp[:, 2]
    np.testing.assert_allclose(ours, mitsuba_values(parameters, to_lamp, to_viewer), rtol=1e-3)  # measured: 6e-6


@pytest.fixture
def scalar():
    """Select the scalar variant of Mitsuba, for single directions."""
    mi.set_variant("scalar_rgb")
    yield
    mi.set_variant(variant())


@pytest.mark.parametrize("model", ["principled", "lambert"])
def test_direct_light_agrees_with_mitsuba(model):
    surfaces = build_surfaces(sandbox(), OPTIONS)
    ours = blocks(
        render_view(surfaces, Camera(CAMERA, LENS), {"lamp": LAMP}, [model], None, OPTIONS).olat_images[model, "lamp"]
    )
    scene = mitsuba_scene(surfaces, CAMERA, LENS, LAMP, OPTIONS.parameters(model))
    theirs = blocks(render(scene, samples=256))
    bright = theirs > 0.3 * np.median(theirs)  # excludes dark blocks dominated by a shadow edge
    assert bright.mean() > 0.7
    np.testing.assert_allclose(ours[bright], theirs[bright], rtol=0.01)
    assert ours.mean() == pytest.approx(theirs.mean(), rel=1e-3)


@pytest.mark.parametrize(
    ("model", "bounces", "changes"),
    [
        ("lambert", 1, {}),
        ("principled", 1, {"wall_albedo": 0.5}),
        ("principled", 3, {"wall_albedo": 0.5}),
        ("principled", 1, {"wall_albedo": 0.5, "bounce_scale": 4, "bounce_rays": 512}),
    ],
)
def test_indirect_light_agrees_with_mitsubas_path_tracer(model, bounces, changes):
    options = OPTIONS.model_copy(update={"bounces": bounces, **changes})
    surfaces = build_surfaces(sandbox(), options)
    view = render_view(surfaces, Camera(CAMERA, LENS), {"lamp": LAMP}, [model], None, options)
    view_of = (surfaces, CAMERA, LENS, LAMP, options.parameters(model))
    traced = mitsuba_scene(*view_of, wall_albedo=options.wall_albedo, integrator="path", bounces=bounces)
    path = render(traced, samples=256)
    direct = render(mitsuba_scene(*view_of, wall_albedo=options.wall_albedo), samples=256)
    ours, theirs = blocks(view.whole[model, "lamp"]), blocks(path)
    bright = theirs > 0.3 * np.median(theirs)
    assert bright.mean() > 0.7
    assert np.abs(ours / theirs - 1)[bright].mean() < 0.01
    np.testing.assert_allclose(ours[bright], theirs[bright], rtol=0.03)
    indirect = view.indirect[model, "lamp"].mean()
    assert indirect > 0.04 * path.mean()  # larger than the tolerance of 3 % above
    assert indirect == pytest.approx((path - direct).mean(), rel=0.03)
