import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy import ndimage

from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.render.lamps import Lamp
from polarsim.render.olat import render_view
from polarsim.render.optics import apply_lens_to_olat_images, lens_flare_of, spread, vignette
from polarsim.render.options import SensorOptions

POINT = np.zeros((81, 101), np.float32)
POINT[40, 50] = 1
LAMPS = {"front": Lamp(np.array([1.2, 0.9, 1.1])), "seen": Lamp(np.array([-1.0, 0.2, 0.5]))}


def second_moment(image):
    """Return the vertical and horizontal variance in a window of 41 x 41 pixels, which limits rounding errors."""
    near, steps = image[20:61, 30:71].astype(float), np.arange(-20, 21)
    return np.array([(near.sum(axis=axis) * steps**2).sum() for axis in (1, 0)]) / near.sum()


def test_an_ideal_lens_returns_the_same_olat_images(surfaces, camera, lens, plain):
    olat_images = render_view(surfaces, Camera(camera, lens), LAMPS, ["lambert"], None, plain).olat_images
    seen = apply_lens_to_olat_images(olat_images, LAMPS, surfaces, Camera(camera, lens), plain)
    assert all(seen[key] is olat_image for key, olat_image in olat_images.items())
    assert list(seen) == list(olat_images)


@given(
    blur_px=st.floats(0, 8),
    bloom=st.floats(0, 0.5),
    bloom_px=st.floats(1, 100),
    veiling_glare=st.floats(0, 0.5),
    size=st.tuples(st.integers(1, 60), st.integers(1, 60)),
)
def test_spreading_preserves_the_total_light(blur_px, bloom, bloom_px, veiling_glare, size):
    options = SensorOptions(blur_px=blur_px, bloom=bloom, bloom_px=bloom_px, veiling_glare=veiling_glare)
    image = np.random.default_rng(1).exponential(size=size).astype(np.float32)
    seen = spread(image, options)
    assert seen.sum(dtype=float) == pytest.approx(image.sum(dtype=float), rel=1e-5)
    assert seen.min() >= 0


@pytest.mark.parametrize("sd_px", [0.3, 0.6, 2.5])
def test_the_variance_of_a_blurred_point_is_exact(sd_px):
    np.testing.assert_allclose(second_moment(spread(POINT, SensorOptions(blur_px=sd_px))), sd_px**2, rtol=2e-3)


def test_wide_blur_agrees_with_scipy(rng):
    image = rng.exponential(size=(90, 70)).astype(np.float32)
    expected = ndimage.gaussian_filter(image, 5.0, mode="reflect", truncate=8)
    np.testing.assert_allclose(spread(image, SensorOptions(blur_px=5.0)), expected, rtol=2e-3)


def test_halo_and_veiling_glare_have_the_given_shares():
    seen = spread(POINT, SensorOptions(bloom=0.2, bloom_px=6, veiling_glare=0.1))
    glare = 0.1 / POINT.size
    assert seen[40, 50] == pytest.approx(0.7 + 0.2 / (2 * np.pi * 6**2) + glare, rel=1e-4)
    assert seen[0, 0] == pytest.approx(glare, rel=1e-3)
    rows, columns = np.indices(POINT.shape)
    within = (rows - 40) ** 2 + (columns - 50) ** 2 <= 12**2
    assert (seen - glare)[within].sum() - 0.7 == pytest.approx(0.2 * (1 - np.exp(-2)), rel=0.02)  # within two sigma


def test_shares_above_1_are_rejected():
    with pytest.raises(ValidationError):
        SensorOptions(bloom=0.7, veiling_glare=0.4)


def test_the_lens_is_linear(surfaces, camera, lens, plain):
    faults = {"blur_px": 0.7, "bloom": 0.02, "veiling_glare": 0.01, "lens_flare": 0.01, "vignetting": True}
    options = plain.model_copy(update=faults)
    olat_images = render_view(surfaces, Camera(camera, lens), LAMPS, ["lambert"], None, plain).olat_images
    seen = apply_lens_to_olat_images(olat_images, LAMPS, surfaces, Camera(camera, lens), options)
    both = olat_images["lambert", "front"] + olat_images["lambert", "seen"]
    flares = [lens_flare_of(surfaces, Camera(camera, lens), lamp, options) for lamp in LAMPS.values()]
    expected = spread(both, options) * vignette(lens) + sum(flares)
    assert all(glare.any() for glare in flares)
    np.testing.assert_allclose(sum(seen.values()), expected, rtol=1e-5, atol=1e-6 * both.max())


def test_results_do_not_depend_on_threads(surfaces, camera, lens, plain):
    options = plain.model_copy(update={"blur_px": 0.7, "bloom": 0.02, "lens_flare": 0.01})
    olat_images = render_view(surfaces, Camera(camera, lens), LAMPS, ["lambert", "hapke"], None, plain).olat_images
    one, two = (
        apply_lens_to_olat_images(olat_images, LAMPS, surfaces, Camera(camera, lens), options, threads)
        for threads in (1, 2)
    )
    for key, olat_image in one.items():
        np.testing.assert_array_equal(two[key], olat_image)


def test_vignetting_is_cos_to_the_fourth():
    lens = Lens(100, 100, 100.5, 50.5, width=201, height=101)
    shade = vignette(lens)
    assert shade[50, 100] == 1
    assert shade[50, 200] == pytest.approx(np.cos(np.pi / 4) ** 4)
