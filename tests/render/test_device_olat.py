"""OLAT images rendered on the Taichi device compared with NumPy and Embree."""

import numpy as np
import pytest
from pydantic import ValidationError

from polarsim.geometry.camera import Camera
from polarsim.render.lamps import Lamp, Spotlight
from polarsim.render.olat import render_view, renders_on_device
from polarsim.render.options import RenderOptions
from polarsim.render.parameters import Material
from polarsim.render.surfaces import build_surfaces

DEVICE = {"engine": "taichi"}
LAMPS = {"sun": Lamp(np.array([1.2, 0.9, 1.1])), "rover": Lamp(np.array([2.4, -0.5, 1.6]), 0.4)}


def both(mesh, pose, lens, options, models, albedo=None, shadow_lamps=("sun",)):
    """Return the renderings of a view by NumPy with Embree and by the device."""
    return [
        render_view(build_surfaces(mesh, each, albedo), Camera(pose, lens), LAMPS, models, shadow_lamps, each)
        for each in (options, options.model_copy(update=DEVICE))
    ]


def assert_close(device, reference):
    for key, expected in reference.olat_images.items():
        assert expected.any()
        off = np.abs(device.olat_images[key] - expected) > 2e-4 * expected.max()
        assert off.mean() < 3e-3, key  # pixels with a sample on an edge
        np.testing.assert_allclose(device.olat_images[key].mean(), expected.mean(), rtol=1e-3)


@pytest.mark.parametrize("samples", [1, 4])
def test_device_and_numpy_render_equal_olat_images_and_ids(blocks, camera, lens, samples):
    options = RenderOptions(samples=samples, falloff=True, ambient=0.02)
    models = ["principled", "hapke", "lunar_lambert", "hapke_chrono", "principled_chrono"]
    reference, device = both(blocks(), camera, lens, options, models)
    assert_close(device, reference)
    for name, ids in reference.ids.items():
        assert (device.ids[name] != ids).mean() < 2e-3


def test_the_device_supports_materials_vertex_albedo_and_diffuse_walls(blocks, camera, lens):
    mesh = blocks((1, 2), ((0.0, 0.0), (0.7, 0.6)))
    materials = {"ground": Material(albedo=0.7), "2": Material(hapke="curtis_apollo11_rough", albedo=1.3)}
    options = RenderOptions(materials=materials, wall_albedo=0.5)
    rng = np.random.default_rng(0)
    albedo = {"hapke": rng.uniform(0.5, 1.5, len(mesh.vertices)).astype(np.float32)}
    reference, device = both(mesh, camera, lens, options, ["hapke", "lambert"], albedo)
    assert_close(device, reference)


@pytest.mark.slow
def test_device_results_do_not_depend_on_threads(blocks, camera, lens, plain):
    options = plain.model_copy(update=DEVICE)
    one, two = (
        render_view(
            build_surfaces(blocks(), options), Camera(camera, lens), LAMPS, ["hapke"], ["sun"], options, threads
        )
        for threads in (1, 2)
    )
    for key, olat_image in one.olat_images.items():
        np.testing.assert_array_equal(olat_image, two.olat_images[key])
    for name, ids in one.ids.items():
        np.testing.assert_array_equal(ids, two.ids[name])


def test_disc_lamps_and_spotlights_are_rendered_by_numpy(blocks, camera, lens, plain):
    discs = {name: Lamp(lamp.position, radius_m=0.05) for name, lamp in LAMPS.items()}
    on_device, on_processor = (build_surfaces(blocks(), plain.model_copy(update=engine)) for engine in (DEVICE, {}))
    assert renders_on_device(on_device, LAMPS)
    assert not renders_on_device(on_device, discs)
    assert not renders_on_device(on_device, {"spot": Spotlight(np.zeros(3))})
    assert not renders_on_device(on_processor, LAMPS)


def test_a_device_without_taichi_is_rejected():
    with pytest.raises(ValidationError):
        RenderOptions(device="cuda")
    assert RenderOptions(device="cuda", engine="taichi").rays == "taichi"
