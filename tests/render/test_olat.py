import sys
from dataclasses import replace

import numpy as np
import pytest

from polarsim.geometry.camera import Camera
from polarsim.photo import PhotoKey
from polarsim.render import brdf
from polarsim.render.hits import cast_strip
from polarsim.render.lamps import REFERENCE_DISTANCE, Lamp, lamps_of_rig, lamps_on
from polarsim.render.maps import compute_maps
from polarsim.render.materials import hemispherical_albedo
from polarsim.render.olat import reflectance_engine, render_view
from polarsim.render.options import CHRONO, RenderOptions
from polarsim.render.parameters import HAPKE_SETS, LambertParameters
from polarsim.render.surfaces import build_surfaces
from polarsim.run_files.rigs import LocalisedRig
from polarsim.site import polar
from tests.support.polar_rig import default_rig
from tests.support.polar_survey import RIG_LAMP

from .conftest import walled

LAMP = Lamp(np.array([1.2, 0.9, 1.1]))


def olat_image(surfaces, pose, lens, lamp, options, model="lambert", threads=1):
    return render_view(surfaces, Camera(pose, lens), {"lamp": lamp}, [model], None, options, threads).olat_images[
        model, "lamp"
    ]


def ground_points(surfaces, pose, lens):
    hits = cast_strip(surfaces, Camera(pose, lens), slice(0, lens.height))
    return hits, surfaces.id_of_face[hits.face] == 1


def test_a_lambert_plane_under_a_near_lamp_has_the_analytic_radiance(surfaces, camera, lens, plain):
    image = olat_image(surfaces, camera, lens, Lamp(np.array([0.3, -0.2, 6.0])), plain).ravel()
    hits, ground = ground_points(surfaces, camera, lens)
    p = hits.point[ground].astype(float)
    to_lamp = np.array([0.3, -0.2, 6.0]) - p
    d = np.linalg.norm(to_lamp, axis=1)
    expected = plain.parameters("lambert").albedo / np.pi * to_lamp[:, 2] / d * REFERENCE_DISTANCE**2 / d**2
    seen = image[hits.pixel[ground]]
    shaded = seen == 0
    assert shaded.mean() < 0.05  # short shadow of the block
    np.testing.assert_allclose(seen[~shaded], expected[~shaded], rtol=1e-5)


def test_without_falloff_irradiance_does_not_depend_on_distance(surfaces, above, lens, plain):
    options = plain.model_copy(update={"falloff": False})
    near, far = (olat_image(surfaces, above, lens, Lamp(np.array([0, 0, z])), options)[70, 100] for z in (5.0, 500.0))
    assert near == pytest.approx(options.parameters("lambert").albedo / np.pi, rel=1e-5)
    assert far == pytest.approx(near, rel=1e-5)


def test_the_shadow_of_a_block_has_the_analytic_length(surfaces, above, lens, plain):
    lamp = Lamp(np.array([3.0, 0.0, 1.0]))
    image = olat_image(surfaces, above, lens, lamp, plain)
    dark_to = -0.2 - 0.2 * (3.0 + 0.2) / (1.0 - 0.2)  # the ray over the top edge (-0.2, ., 0.2) at z = 0
    centre = np.array([[x, 0.0, 0.0] for x in (dark_to - 0.03, dark_to + 0.03, -0.25, 0.25)])
    columns, rows = np.floor(lens.project(above.inverse().apply(centre))).astype(int).T
    assert (image[rows, columns] > 0).tolist() == [True, False, False, True]


def test_a_level_plane_has_no_shadow_on_itself_even_at_grazing_light(lens, camera, plain, surfaces):
    lamp = Lamp(np.array([4.0, 0.0, 0.1]))  # 1.4 degrees above the horizon
    image = olat_image(surfaces, camera, lens, lamp, plain).ravel()
    hits, ground = ground_points(surfaces, camera, lens)
    lamp_side = ground & (hits.point[:, 0] > 0.25)  # between block and lamp
    assert lamp_side.sum() > 3000
    assert (image[hits.pixel[lamp_side]] > 0).all()


def test_a_lamp_behind_the_ground_lights_nothing(surfaces, camera, lens, plain):
    assert not olat_image(surfaces, camera, lens, Lamp(np.array([0.5, 0.5, -2.0])), plain).any()


def test_olat_images_scale_with_the_intensity(surfaces, camera, lens, plain):
    one = olat_image(surfaces, camera, lens, LAMP, plain, "hapke")
    half = olat_image(surfaces, camera, lens, Lamp(LAMP.position, 0.5), plain, "hapke")
    np.testing.assert_allclose(half, one / 2, rtol=1e-6)


@pytest.mark.parametrize("model", ["principled", "hapke", "lunar_lambert"])
def test_all_models_light_the_same_pixels_with_finite_values(surfaces, camera, lens, plain, model):
    image = olat_image(surfaces, camera, lens, LAMP, plain, model)
    assert np.isfinite(image).all()
    assert (image >= 0).all()
    np.testing.assert_array_equal(image > 0, olat_image(surfaces, camera, lens, LAMP, plain) > 0)


@pytest.mark.parametrize("model", ["principled", "hapke"])
def test_numba_and_numpy_render_the_same_olat_image(surfaces, camera, lens, plain, model):
    fast, slow = (
        olat_image(surfaces, camera, lens, LAMP, plain.model_copy(update={"engine": name}), model)
        for name in ("numba", "numpy")
    )
    np.testing.assert_allclose(fast, slow, rtol=1e-4)


def test_embree_and_numpy_rays_give_the_same_olat_image(blocks, surfaces, camera, lens, plain):
    slow = olat_image(replace(build_surfaces(blocks(), plain), rays="numpy"), camera, lens, LAMP, plain)
    fast = olat_image(surfaces, camera, lens, LAMP, plain)
    differ = np.abs(slow - fast) > 1e-5 * slow.max()
    assert differ.mean() < 2e-3  # pixels with the centre on an edge


@pytest.mark.parametrize("radius_m", [0, 0.2])
def test_results_do_not_depend_on_threads(surfaces, camera, lens, plain, radius_m):
    """OLAT images, ids and maps have equal bits."""
    lamps, results = {"sun": Lamp(LAMP.position, radius_m=radius_m)}, []
    for threads in (1, 2):
        view = render_view(surfaces, Camera(camera, lens), lamps, ["hapke"], ["sun"], plain, threads)
        maps = compute_maps(surfaces, Camera(camera, lens), lamps, plain, threads)
        under = maps.by_lamp["sun"]
        pictures = (maps.depth_m, maps.ids, under.lit, under.shading)
        results.append((view.olat_images["hapke", "sun"], view.ids["sun"], *pictures))
    for one, two in zip(*results, strict=True):
        np.testing.assert_array_equal(one, two)


def test_four_samples_soften_edges_and_keep_the_mean(surfaces, camera, lens, plain):
    one = olat_image(surfaces, camera, lens, LAMP, plain)
    four = olat_image(surfaces, camera, lens, LAMP, plain.model_copy(update={"samples": 4}))
    assert len(np.unique(four)) > len(np.unique(one))
    assert four.mean() == pytest.approx(one.mean(), rel=2e-3)


def test_bounce_reaches_shadows_except_with_chronos_models(surfaces, above, lens, plain):
    lamp = Lamp(np.array([3.0, 0.0, 1.0]))
    image = olat_image(surfaces, above, lens, lamp, plain.model_copy(update={"bounce": 0.1}))
    column, row = np.floor(lens.project(above.inverse().apply(np.array([-0.4, 0.0, 0.0])))).astype(int)
    assert image[row, column] == pytest.approx(0.1 * plain.parameters("lambert").albedo / np.pi, rel=1e-5)
    for model in CHRONO:
        image = olat_image(surfaces, above, lens, lamp, plain.model_copy(update={"bounce": 0.1}), model)
        assert image[row, column] == 0
        assert image.max() > 0


def test_walls_cast_shadows_on_the_sand(blocks, above, lens):
    lamp = Lamp(np.array([3.5, 0.0, 1.2]))
    around, bare = (build_surfaces(walled(blocks(), 1.3), RenderOptions(walls=walls)) for walls in (True, False))
    options = RenderOptions(bounce=0)
    with_walls, without = (olat_image(surfaces, above, lens, lamp, options).ravel() for surfaces in (around, bare))
    hits, ground = ground_points(around, above, lens)
    reach = 1.3 - 0.28 * (3.5 - 1.3) / (1.2 - 0.28)  # the ray over the inner top edge of the wall
    centre = ground & (np.abs(hits.point[:, 1]) < 0.15)
    banded = hits.pixel[centre & (hits.point[:, 0] > reach + 0.03)]
    free = hits.pixel[centre & (hits.point[:, 0] < reach - 0.03) & (hits.point[:, 0] > 0.3)]
    assert min(len(banded), len(free)) > 100
    assert not with_walls[banded].any()
    assert (without[banded] > 0).all()
    assert (with_walls[free] > 0).all()


def test_albedo_of_lambert_and_of_lunar_soil():
    assert hemispherical_albedo(LambertParameters(albedo=0.3)) == pytest.approx(0.3)
    # Gauss quadrature by an independent program.
    assert hemispherical_albedo(HAPKE_SETS["chrono_lunar"]) == pytest.approx(0.1295, rel=5e-3)


def test_the_rover_light_is_between_the_cameras(camera):
    lamp = lamps_of_rig({}, LocalisedRig(default_rig(), camera), polar())["rover"]
    np.testing.assert_allclose(camera.inverse().apply(lamp.position), [0.15, 0, 0], atol=1e-12)
    assert lamp.intensity == RIG_LAMP.share


def test_the_lamps_of_a_key():
    lamps = {"off_30": ("30",), "on_30": ("30", "rover"), "on_no": ("rover",), "off_no": ()}
    assert {name: lamps_on(PhotoKey.parse(f"01_A_{name}_L_0256")) for name in lamps} == lamps


def test_an_engine_that_cannot_be_loaded_is_an_error(surfaces, camera, lens, plain, monkeypatch):
    monkeypatch.delattr("polarsim.render.brdf_taichi", raising=False)
    monkeypatch.setitem(sys.modules, "polarsim.render.brdf_taichi", None)
    with pytest.raises(ImportError):
        olat_image(surfaces, camera, lens, LAMP, plain.model_copy(update={"engine": "taichi"}))


def test_numpy_replaces_only_the_default_engine_where_numba_is_not_installed(monkeypatch):
    monkeypatch.setattr("polarsim.render.olat.NUMBA", False)
    assert reflectance_engine(RenderOptions(), 1) is brdf.reflectance
    monkeypatch.setitem(sys.modules, "polarsim.render.brdf_numba", None)
    monkeypatch.delattr("polarsim.render.brdf_numba", raising=False)
    with pytest.raises(ImportError):
        reflectance_engine(RenderOptions(engine="numba"), 1)
