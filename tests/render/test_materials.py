"""Materials of objects and vertex albedo affect only the named objects."""

import numpy as np
import pytest
from pydantic import ValidationError

from polarsim.geometry.camera import Camera
from polarsim.render.hits import cast_strip
from polarsim.render.lamps import Lamp
from polarsim.render.olat import render_view
from polarsim.render.options import RenderOptions
from polarsim.render.parameters import LambertParameters, Material
from polarsim.render.surfaces import build_surfaces
from polarsim.run_files.instances import BACKGROUND, GROUND, ROCK_IDS

from .conftest import walled

LAMP = Lamp(np.array([1.2, 0.9, 1.1]))
TWO = ((1, 2), ((0.3, 0.0), (-0.4, 0.3)))  # blocks


@pytest.fixture
def mesh(blocks):
    return blocks(*TWO)


def olat_image(mesh, pose, lens, options, model="lambert", albedo=None):
    surfaces = build_surfaces(mesh, options, albedo)
    image = render_view(surfaces, Camera(pose, lens), {"lamp": LAMP}, [model], None, options).olat_images[model, "lamp"]
    hits = cast_strip(surfaces, Camera(pose, lens), slice(0, lens.height))
    ids = np.zeros(image.size, int)
    ids[hits.pixel] = surfaces.id_of_face[hits.face]
    return image.ravel(), ids


def with_(options, **changed):
    return RenderOptions.model_validate(options.model_dump() | changed)


@pytest.mark.parametrize("engine", ["numba", "numpy"])  # for taichi see test_device_olat
@pytest.mark.parametrize(
    ("name", "shown", "surround"),
    [
        ("ground", [GROUND], {"ambient": 0.05}),
        ("rocks", [ROCK_IDS + 1, ROCK_IDS + 2], {"bounce": 0.05}),
        ("2", [ROCK_IDS + 2], {}),
        ("walls", [BACKGROUND], {"walls": True}),
    ],
)
def test_an_albedo_factor_scales_only_the_named_objects(mesh, camera, lens, plain, engine, surround, name, shown):
    mesh, options = walled(mesh, 1.0), with_(plain, engine=engine, **surround)
    plainly, ids = olat_image(mesh, camera, lens, options, "hapke")
    brighter, _ = olat_image(mesh, camera, lens, with_(options, materials={name: Material(albedo=1.5)}), "hapke")
    named = np.isin(ids, shown) & (plainly > 0)
    assert (plainly[named] > 0).sum() > 50
    np.testing.assert_allclose(brighter[named], 1.5 * plainly[named], rtol=1e-6)
    np.testing.assert_array_equal(brighter[~named], plainly[~named])


@pytest.mark.parametrize("engine", ["numba", "numpy"])  # for taichi see test_device_olat
def test_each_rock_uses_the_parameters_of_its_material(mesh, camera, lens, plain, engine):
    options = with_(plain, engine=engine)
    rocky = {"rocks": Material(hapke="sato_mare_643"), "2": Material(hapke="sato_highlands_643")}
    mixed, ids = olat_image(mesh, camera, lens, with_(options, materials=rocky), "hapke")
    for thing, soil in (
        (GROUND, "chrono_lunar"),
        (ROCK_IDS + 1, "sato_mare_643"),
        (ROCK_IDS + 2, "sato_highlands_643"),
    ):
        alone, _ = olat_image(mesh, camera, lens, options.with_default(hapke=soil), "hapke")
        np.testing.assert_allclose(mixed[ids == thing], alone[ids == thing], rtol=1e-6)


def test_missing_keys_of_a_rock_are_read_from_the_material_of_all_rocks(plain):
    options = with_(
        plain,
        materials={"rocks": Material(albedo=2, lambert=LambertParameters(albedo=0.4)), "7": Material(albedo=3)},
    )
    assert options.parameters("lambert", "7", "rocks").albedo == 0.4
    assert options.albedo_factor("7", "rocks") == 3
    assert options.albedo_factor("8", "rocks") == 2
    assert options.albedo_factor("ground") == 1
    written = RenderOptions.model_validate(options.model_dump() | {"materials": {**options.materials, "8": Material()}})
    assert written.albedo_factor("8", "rocks") == 2
    assert written.with_default(lambert={"albedo": 0.1}).parameters("lambert", "8", "rocks").albedo == 0.4
    assert written.with_default(lambert={"albedo": 0.1}).parameters("lambert", "ground").albedo == 0.1


@pytest.mark.parametrize("name", ["stones", "1.5", ""])
def test_a_material_of_an_unknown_object_is_rejected(name):
    with pytest.raises(ValidationError):
        RenderOptions(materials={name: Material()})


def test_materials_equal_to_the_defaults_have_no_effect(mesh, camera, lens, plain):
    options = with_(plain, bounce=0.05)
    same = {"ground": Material(), "1": Material(lambert=options.parameters("lambert")), "rocks": Material(albedo=1)}
    np.testing.assert_array_equal(
        olat_image(mesh, camera, lens, options)[0], olat_image(mesh, camera, lens, with_(options, materials=same))[0]
    )


@pytest.mark.parametrize("engine", ["numba", "numpy"])  # for taichi see test_device_olat
def test_vertex_albedo_is_interpolated_linearly(mesh, camera, lens, plain, engine):
    options = with_(plain, engine=engine, bounce=0.02)
    plainly, ids = olat_image(mesh, camera, lens, options)
    factor = 1 + 0.2 * mesh.vertices[:, 0] - 0.1 * mesh.vertices[:, 1] + 0.3 * mesh.vertices[:, 2]
    painted, _ = olat_image(mesh, camera, lens, options, albedo={"lambert": factor})
    hits = cast_strip(build_surfaces(mesh, options), Camera(camera, lens), slice(0, lens.height))
    expected = np.ones(len(ids))
    expected[hits.pixel] = 1 + hits.point @ [0.2, -0.1, 0.3]
    np.testing.assert_allclose(painted, plainly * expected, rtol=2e-5)


def test_vertex_albedo_scales_indirect_light(mesh, camera, lens, plain):
    options = with_(plain, bounces=1, bounce_rays=4, bounce_scale=1)
    grey = options.with_default(lambert=LambertParameters(albedo=0.1))
    factor = {"lambert": np.full(len(mesh.vertices), 0.5)}
    one, other = (
        render_view(
            build_surfaces(mesh, each, paint), Camera(camera, lens), {"lamp": LAMP}, ["lambert"], None, each
        ).whole
        for each, paint in ((grey, None), (options, factor))
    )
    np.testing.assert_allclose(other["lambert", "lamp"], one["lambert", "lamp"], rtol=1e-5)


def test_skirts_have_the_mean_albedo_of_the_rock_and_walls_have_1(blocks, plain):
    mesh = blocks()
    open_below = mesh.faces[~(mesh.vertices[mesh.faces][:, :, 2] == 0).all(axis=1) | (mesh.rock_of_face < 0)]
    kept = np.isin(mesh.faces, open_below).all(axis=1) & (
        ~(mesh.vertices[mesh.faces][:, :, 2] == 0).all(axis=1) | (mesh.rock_of_face < 0)
    )
    mesh = walled(type(mesh)(mesh.vertices, mesh.faces[kept], mesh.rock_of_face[kept], mesh.given_normals), 2.05)
    factor = np.where(np.arange(len(mesh.vertices)) < 4, 1.0, 0.7)
    surfaces = build_surfaces(mesh, with_(plain, walls=True, skirt_m=0.05), {"lambert": factor})
    added = surfaces.albedo["lambert"][len(mesh.vertices) :]
    walls = np.unique(surfaces.faces[surfaces.id_of_face == BACKGROUND]) - len(mesh.vertices)
    np.testing.assert_array_equal(added[walls], 1)
    feet = np.setdiff1d(np.arange(len(added)), walls)
    assert len(feet) == 16  # four rims, four corners each
    np.testing.assert_allclose(added[feet], 0.7, rtol=1e-6)
