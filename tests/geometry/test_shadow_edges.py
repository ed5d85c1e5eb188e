"""Shadow edges in synthetic profiles of known position."""

import numpy as np
import pytest

from polarsim.geometry.shadow_edges import segment_share, shadow_edge_offsets

STEP, WIDTH = 0.0025, 0.12


def profile(edge: float, dark: float = 0.1, lit: float = 2.0, width: float = WIDTH) -> np.ndarray:
    """Return the brightness (k,) of a shadow edge at an offset, 0.5 m on both sides."""
    at = np.arange(-200, 201) * STEP
    return dark + (lit - dark) * segment_share((at - edge) / width)


def fitted(*profiles: np.ndarray, width: float = WIDTH) -> np.ndarray:
    return shadow_edge_offsets(np.array(profiles), np.full(len(profiles), width), STEP, 0.3)


def test_the_visible_share_of_a_disc_is_the_area_of_a_circular_segment():
    # The segment below the line at half a radius: (arccos(1/2) - 1/2 sqrt(3/4)) / pi = 0.1955.
    np.testing.assert_allclose(
        segment_share(np.array([-2, -1, -0.5, 0, 0.5, 1, 3])), [0, 0, 0.1955, 0.5, 0.8045, 1, 1], atol=1e-4
    )


@pytest.mark.parametrize("edge", [-0.21, -0.0312, 0.0, 0.1, 0.25])
def test_an_edge_is_located_to_a_fraction_of_the_step(edge):
    np.testing.assert_allclose(fitted(profile(edge), 7 * profile(edge)), edge, atol=0.001)


@pytest.mark.parametrize("width", [0.19, 0.23, 0.28])
def test_the_edge_of_a_wide_penumbra_is_located(width):
    """Half widths under lamps at 8 to 10 degrees exceed the shortest window."""
    for edge in (-0.05, 0.08):
        np.testing.assert_allclose(fitted(profile(edge, width=width), width=width), edge, atol=0.002)


def test_no_edge_is_located_beyond_the_reach_or_in_a_profile_shorter_than_the_penumbra():
    short = profile(0.0)[100:-100]  # 0.25 m on both sides
    assert np.isnan(shadow_edge_offsets(profile(0.2)[None], np.array([WIDTH]), STEP, 0.1)).all()
    assert np.isnan(shadow_edge_offsets(short[None], np.array([0.25]), STEP, 0.3)).all()


def test_grain_of_the_sand_moves_single_edges_by_two_centimetres_and_the_median_by_one(rng):
    grain = np.repeat(rng.lognormal(0, 0.4, (60, 41)), 10, axis=1)[:, :401]  # patches of 2.5 cm
    found = fitted(*(profile(0.05) * grain))
    assert np.isfinite(found).mean() > 0.9
    assert np.nanmedian(found) == pytest.approx(0.05, abs=0.01)
    assert np.nanmedian(np.abs(found - 0.05)) < 0.02


@pytest.mark.parametrize(("width", "error"), [(0.06, 0.02), (0.09, 0.01), (0.15, 0.01)])
def test_a_wrong_width_of_the_penumbra_hardly_moves_the_edge(width, error):
    np.testing.assert_allclose(fitted(profile(0.05, width=width)), 0.05, atol=error)


def test_profiles_without_an_edge_have_no_offset(rng):
    flat = np.ones(401) * rng.lognormal(0, 0.4, 401)
    faint = profile(0.0, dark=1.5, lit=2.0)
    reversed_edge = profile(0.0)[::-1]
    far = profile(0.45)  # next to the end of the profile
    hidden = np.where(np.abs(np.arange(401) - 200) < 60, np.nan, profile(0.0))
    assert np.isnan(fitted(flat, faint, reversed_edge, far, hidden, np.full(401, np.nan), np.zeros(401))).all()
