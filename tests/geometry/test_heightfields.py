"""Self-affine relief: height differences over a distance, at arbitrary nodes."""

import numpy as np
import pytest

from polarsim.geometry.heightfields import amplitudes, octave_relief, spacings


def made(x, y, hurst, seed=0, deviation=0.03, finest=0.1):
    spacing = spacings(finest, 40.0)
    amplitude = amplitudes(spacing, hurst, deviation)
    return octave_relief(x, y, spacing=spacing, amplitude=amplitude, half_m=30.0, far_m=30.0, seed=seed)


@pytest.mark.parametrize("hurst", [0.4, 0.7])
def test_height_differences_follow_a_power_law(hurst):
    x = np.arange(-30, 30.01, 0.05)
    squares = []
    for seed in range(4):
        level = made(x, x[200:-200], hurst, seed)
        squares.append([np.mean((level[:, lag:] - level[:, :-lag]) ** 2) for lag in (10, 20, 40, 80)])
    deviation = np.sqrt(np.mean(squares, axis=0))
    assert deviation[1] == pytest.approx(0.03, rel=0.05)  # over 1 m
    power = np.polyfit(np.log([0.5, 1, 2, 4]), np.log(deviation), 1)[0]
    assert power == pytest.approx(hurst, abs=0.05)


def test_fine_and_coarse_nodes_show_the_same_ground():
    fine = np.linspace(-3, 3, 61)
    coarse = fine[::6]
    np.testing.assert_allclose(
        made(coarse, coarse, 0.8, finest=1.2), made(fine, fine, 0.8, finest=1.2)[::6, ::6], atol=1e-12
    )


def test_fine_columns_show_no_ridges_across_coarse_rows():
    """Rows with a distance of 1 m cannot show finer octaves; with fine columns they would become ridges."""
    x = np.arange(-2, 2, 0.02)
    coarse, fine = (made(x, y, 0.4) for y in (np.arange(-20, 20.5, 1.0), x))
    assert np.diff(coarse, axis=1).std() < 0.25 * np.diff(fine, axis=1).std()


def test_fine_octaves_fade_with_distance_without_a_step():
    spacing = np.array([1.0])
    x = np.arange(0.0, 40.0, 0.1)
    level = octave_relief(x, x[:5], spacing=spacing, amplitude=np.ones(1), half_m=20.0, far_m=100.0, seed=0)
    assert np.abs(level[:, x < 20]).max() > 0.3
    assert not level[:, x > 23].any()
    assert np.abs(np.diff(level, axis=1)).max() < 0.2  # as everywhere


def test_without_octaves_there_is_no_relief():
    assert not len(spacings(0.1, 0.1))
    assert not octave_relief(
        np.zeros(2), np.zeros(3), spacing=spacings(0.1, 0.05), amplitude=amplitudes(spacings(0.1, 0.05), 0.5, 1.0),
        half_m=1.0, far_m=1.0, seed=0,
    ).any()  # fmt: skip
