"""Texture of images, which neither brightness nor edges change."""

import numpy as np

from polarsim.geometry.contrast import texture

NOISE = np.random.default_rng(0).normal(scale=0.05, size=(60, 80)).astype(np.float32)


def test_an_edge_does_not_change_the_texture_of_both_sides():
    step = np.where(np.arange(80) < 40, 0.0, 2.0).astype(np.float32)
    np.testing.assert_allclose(texture(NOISE + step, 0.2, 0.03), texture(NOISE, 0.2, 0.03), atol=0.35)
    away = np.abs(np.arange(80) - 39.5) > 12
    np.testing.assert_allclose(texture(NOISE + step, 0.2, 0.03)[:, away], texture(NOISE, 0.2, 0.03)[:, away], atol=0.02)


def test_brightness_does_not_change_texture():
    np.testing.assert_allclose(texture(NOISE + 3, 0.2, 0.03), texture(NOISE, 0.2, 0.03), atol=1e-3)


def test_unknown_cells_have_no_texture():
    holes = NOISE.copy()
    holes[20:30, 20:30] = np.nan
    assert (texture(holes, 0.2, 0.03)[20:30, 20:30] == 0).all()
    assert (texture(np.full_like(NOISE, np.nan), 0.2, 0.03) == 0).all()
    assert np.abs(texture(holes, 0.2, 0.03)).max() <= 2
