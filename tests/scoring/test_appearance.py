"""Appearance: invariant to the tone curve and to ignored pixels, sensitive to structure."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.photo import BLACK_LEVEL
from polarsim.scoring.appearance import compare_appearance, fit_tone, log_ratio, structural_similarity
from polarsim.tone import to_8bit
from tests.support.polar_photos import HEIGHT, WIDTH

METRICS = ("psnr_db", "ssim", "correlation")


@pytest.fixture(scope="module")
def photo() -> np.ndarray:
    """Smooth relief under light from the side, with a dark block, 12 bits."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    light = 900 + 500 * np.sin(x / 61) * np.cos(y / 83) + 200 * np.sin((x + y) / 23)
    light[400:600, 700:1000] = 80
    return (BLACK_LEVEL + light).astype(np.uint16)


@pytest.fixture(scope="module")
def drawn() -> np.ndarray:
    """Frame of lines around the dark block."""
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[390:610, 690:1010] = True
    mask[398:602, 698:1002] = False
    return mask


def test_a_photo_looks_like_itself(photo):
    result = compare_appearance(photo, photo)
    assert result.psnr_db > 45
    assert result.ssim > 0.995
    assert result.correlation > 0.999
    assert result.stops == result.log2_twin_over_photo == result.log2_difference == 0


@pytest.mark.parametrize("curve", [lambda v: 0.5 * v, lambda v: 4 * v**0.8, lambda v: 30 * np.sqrt(v)])
def test_a_tone_curve_does_not_count(photo, curve):
    light = photo.astype(float) - BLACK_LEVEL
    result = compare_appearance(photo, (BLACK_LEVEL + curve(light)).astype(np.uint16))
    assert result.psnr_db > 35
    assert result.ssim > 0.98


def test_a_tone_curve_of_squares_of_equal_pixels_changes_no_bit(photo):
    blocks = np.kron(photo[2::4, 2::4], np.ones((4, 4), np.uint16))
    curved = (BLACK_LEVEL + 2 * (blocks - BLACK_LEVEL)).astype(np.uint16)
    plain, other = compare_appearance(photo, blocks), compare_appearance(photo, curved)
    assert [getattr(plain, name) for name in METRICS] == [getattr(other, name) for name in METRICS]
    assert other.log2_twin_over_photo == pytest.approx(1 + plain.log2_twin_over_photo)


def test_brightness_without_its_median_is_measured_in_stops(photo):
    light = photo.astype(float) - BLACK_LEVEL
    half = compare_appearance(photo, (BLACK_LEVEL + light / 2).astype(np.uint16))
    assert half.stops < 0.01
    assert half.log2_twin_over_photo == pytest.approx(-1, abs=0.01)
    assert half.log2_difference == pytest.approx(1, abs=0.01)
    fading = light * 0.25 ** np.linspace(0, 1, WIDTH)  # 0.2 to 1.8 stops over the compared columns
    assert compare_appearance(photo, (BLACK_LEVEL + fading).astype(np.uint16)).stops == pytest.approx(0.4, abs=0.05)


def test_dark_and_clipped_pixels_have_no_ratio():
    photo = np.array([800.0, 800, 20, 800, 4070])
    np.testing.assert_allclose(log_ratio(photo, np.array([400.0, 1600, 400, 4070, 400])), [-1, 1])


def test_a_published_photo_has_no_brightness(photo):
    """The tone curve of 8-bit photos is unknown."""
    result = compare_appearance(to_8bit(photo)[..., 0], photo)
    assert result.ssim > 0.98
    assert result.lit_px == 0
    assert all(map(math.isnan, (result.stops, result.log2_twin_over_photo, result.log2_difference)))


@pytest.mark.parametrize("other", ["mirrored", "flat"])
def test_other_structure_counts(photo, other):
    twin = photo[:, ::-1] if other == "mirrored" else np.full_like(photo, 1000)
    result = compare_appearance(photo, np.ascontiguousarray(twin))
    assert result.psnr_db < 20
    assert result.ssim < 0.75
    assert result.correlation < 0.5


def test_a_larger_shift_lowers_every_metric(photo):
    scores = [compare_appearance(photo, np.roll(photo, shift, axis=1)) for shift in (0, 4, 8, 16)]
    for name in METRICS:
        values = [getattr(score, name) for score in scores]
        assert values == sorted(values, reverse=True)
        assert len(set(values)) == 4


def test_ignored_pixels_do_not_matter(photo, drawn):
    twin = np.roll(photo, 4, axis=1)
    plain = compare_appearance(photo, twin, drawn)
    for value in (0, 4095):
        lined = np.where(drawn, value, photo).astype(np.uint16)
        assert compare_appearance(lined, np.where(drawn, 4095 - value, twin).astype(np.uint16), drawn) == plain
    assert compare_appearance(np.where(drawn, 4095, photo).astype(np.uint16), twin).ssim < plain.ssim


def test_a_photo_without_a_valid_pixel_has_no_score(photo):
    result = compare_appearance(photo, photo, np.ones(photo.shape, bool))
    assert math.isnan(result.psnr_db)
    assert result.lit_px == 0


@given(seed=st.integers(0, 2**31))
def test_the_fitted_curve_increases_and_is_best(seed):
    random = np.random.default_rng(seed)
    twin = random.integers(0, 20, (8, 9)).astype(np.float32)
    photo = random.normal(0, 1, (8, 9)) + 0.1 * twin
    fitted = fit_tone(twin, photo).apply(twin)
    order = np.argsort(twin.ravel(), kind="stable")
    assert (np.diff(fitted.ravel()[order]) >= -1e-6).all()
    shuffled = random.permutation(twin.size)
    again = fit_tone(twin.ravel()[shuffled], photo.ravel()[shuffled]).apply(twin)
    np.testing.assert_allclose(again, fitted, atol=1e-6)
    line = np.polyfit(twin.ravel(), photo.ravel(), 1)
    if line[0] >= 0:  # an increasing line is one of the curves
        assert ((photo - fitted) ** 2).sum() <= ((photo - np.polyval(line, twin)) ** 2).sum() + 1e-4


def test_structural_similarity_of_contrast_has_the_value_of_the_formula():
    """Two constant images: only the luminance term remains, (2 a b + c1) / (a^2 + b^2 + c1)."""
    first, second = np.full((32, 32), 100, np.float32), np.full((32, 32), 50, np.float32)
    c1 = (0.01 * 255) ** 2
    assert structural_similarity(first, second) == pytest.approx((2 * 5000 + c1) / (12500 + c1), rel=1e-4)
