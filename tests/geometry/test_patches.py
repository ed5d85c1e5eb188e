import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter, shift

from polarsim.geometry.patches import MatchingOptions, match_windows
from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL

WINDOW = MatchingOptions(half=10, search=5, step=12, likeness=0.6, noise=0.4)
EVERYWHERE = np.ones((120, 160), bool)


def picture(seed=1, size=(120, 160)):
    return 1000 + 150 * gaussian_filter(np.random.default_rng(seed).normal(size=size), 2, mode="wrap") / 0.14


@settings(max_examples=15, deadline=None)
@given(st.floats(-4, 4), st.floats(-4, 4))
def test_a_translated_image_is_matched(dx, dy):
    shaded = picture()
    photo = shift(shaded, (dy, dx), order=3, mode="wrap") + BLACK_LEVEL
    found = match_windows(shaded.astype(np.float32), photo.astype(np.float32), EVERYWHERE, WINDOW)
    assert len(found.pixel) > 20
    moved = np.median(found.seen - found.pixel, axis=0)
    np.testing.assert_allclose(moved, [dx, dy], atol=0.1)  # parabolas bias peaks to integer pixels


def test_matching_ignores_brightness_but_not_content():
    shaded = picture().astype(np.float32)
    brighter = match_windows(shaded / 5000, (3 * shaded + BLACK_LEVEL) / 1.2, EVERYWHERE, WINDOW)
    assert np.abs(brighter.seen - brighter.pixel).max() < 0.3
    assert len(match_windows(shaded, picture(seed=2).astype(np.float32), EVERYWHERE, WINDOW).pixel) < 0.1 * len(
        brighter.pixel
    )


@pytest.mark.parametrize("empty", ["unusable", "clipped", "black"])
def test_windows_without_texture_are_skipped(empty):
    shaded = picture().astype(np.float32)
    photo, usable = shaded + BLACK_LEVEL, EVERYWHERE
    if empty == "unusable":
        usable = ~EVERYWHERE
    elif empty == "clipped":
        photo = np.full_like(shaded, WHITE_LEVEL)
    else:
        shaded = np.zeros_like(shaded)
    found = match_windows(shaded, photo, usable, WINDOW)
    assert found.pixel.shape == found.seen.shape == (0, 2)
    assert found.whitening.shape == (0, 2, 2)


def test_a_window_on_an_edge_is_accurate_only_across_the_edge():
    rng = np.random.default_rng(1)
    y, x = np.mgrid[:120, :160]
    shaded = 1000 + 400 * np.tanh((x + 0.5 * y - 110) / 2) + 0.2 * picture()
    photo = shaded + BLACK_LEVEL + rng.normal(0, 10, shaded.shape)
    found = match_windows(shaded.astype(np.float32), photo.astype(np.float32), EVERYWHERE, WINDOW)
    edge = np.abs(found.pixel @ [1, 0.5] - 110) < 5
    assert edge.any()
    across = np.array([1, 0.5]) / np.hypot(1, 0.5)
    strength, axes = np.linalg.eigh(found.whitening[edge])
    assert (np.abs(axes[:, :, 1] @ across) > 0.95).all()
    assert (strength[:, 1] > 3 * strength[:, 0]).all()


def test_stated_deviations_equal_the_effect_of_noise():
    rng = np.random.default_rng(2)
    shaded = picture(size=(300, 400))
    moves = []
    for _ in range(5):
        photo = (
            shaded + BLACK_LEVEL + gaussian_filter(rng.normal(0, 300, shaded.shape), 1.5)
        )  # as similar as shaded views are
        found = match_windows(shaded.astype(np.float32), photo.astype(np.float32), np.ones(shaded.shape, bool), WINDOW)
        moves.append(np.einsum("nkl,nl->nk", found.whitening, found.seen - found.pixel))
    assert 0.3 < np.concatenate(moves).std() < 1.5
