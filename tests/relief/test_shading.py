"""Shape from shading recovers known relief, and ignores everything that must not matter."""

from dataclasses import replace

import numpy as np
import pytest

from polarsim.errors import ReconstructionError
from polarsim.geometry.rays import NumpyCaster
from polarsim.relief.heights import INFERRED, MEASURED, HeightMap
from polarsim.relief.shading import refine
from tests.relief.synthetic import GRID, NOTHING, PARAMETERS, bump, level, photo, rocks

INNER = (np.abs(GRID.centres()) < 0.45).all(axis=-1)
NO_MASK = np.zeros(GRID.shape, bool)
PAIR, ALL = ("30", "180"), ("30", "180", "270", "350")


def inferred(heights, azimuths, masked=NO_MASK, start=None, **changes):
    views = [photo(heights, azimuth, **changes) for azimuth in azimuths]
    return refine(start or level(), views, masked, NOTHING, PARAMETERS)


def error(estimate: np.ndarray, truth: np.ndarray) -> float:
    """Return the standard deviation of the error of heights, relative to that of the relief."""
    return float((estimate - truth)[INNER].std() / truth[INNER].std())


@pytest.mark.parametrize(("height", "sigma"), [(0.02, 0.08), (-0.03, 0.1)], ids=["bump", "bowl"])
def test_relief_is_recovered(height, sigma):
    """The light field is unknown, which limits the accuracy of relief as wide as the ground."""
    truth = bump(height=height, sigma=sigma)
    assert error(inferred(truth, PAIR).height_m, truth) < 0.42
    assert error(inferred(truth, ALL).height_m, truth) < 0.28


def test_flat_ground_remains_flat():
    flat = inferred(np.zeros(GRID.shape), ALL)
    assert np.abs(flat.height_m[INNER]).max() < 1e-4
    assert set(np.unique(flat.kind[INNER])) == {INFERRED}


def test_the_brightness_of_photos_does_not_matter():
    truth = bump()
    views = [photo(truth, azimuth) for azimuth in PAIR]
    bright = [replace(view, picture=view.picture * np.float32(2**number)) for number, view in enumerate(views, 1)]
    results = [refine(level(), some, NO_MASK, NOTHING, PARAMETERS).height_m for some in (views, bright)]
    np.testing.assert_allclose(*results, atol=1e-5)


def test_the_order_of_photos_does_not_matter():
    truth = bump()
    views = [photo(truth, azimuth) for azimuth in PAIR]
    results = [refine(level(), some, NO_MASK, NOTHING, PARAMETERS).height_m for some in (views, views[::-1])]
    np.testing.assert_allclose(*results, atol=1e-6)


def test_pixels_of_masked_cells_do_not_matter():
    masked = NO_MASK.copy()
    masked[30:40, 30:50] = True
    flat = np.zeros(GRID.shape)
    rock = flat.copy()
    rock[33:37, 34:46] = 0.004
    heights = [inferred(one, PAIR, masked).height_m for one in (flat, rock)]
    assert np.abs(heights[0] - heights[1])[INNER & ~masked].max() < 1.5e-3


def test_certain_heights_do_not_change():
    truth = bump()
    scanned = HeightMap(GRID, truth, np.full(GRID.shape, 1e-5), np.full(GRID.shape, MEASURED, np.uint8))
    refined = inferred(np.zeros(GRID.shape), ALL, start=scanned)  # contradicts the scan
    assert np.abs(refined.height_m - truth).max() < 2e-4
    assert (refined.kind == MEASURED).all()


def test_shading_improves_a_noisy_scan():
    truth = bump(0.1, 0.1) + bump(-0.2, 0.0, 0.01, 0.04)
    noise = np.random.default_rng(0).normal(0, 1e-3, GRID.shape)
    scanned = HeightMap(GRID, truth + noise, np.full(GRID.shape, 1e-3), np.full(GRID.shape, MEASURED, np.uint8))
    refined = inferred(truth, ALL, start=scanned)
    slopes = [
        np.stack(np.gradient(one - truth, GRID.cell))[:, INNER].std() for one in (noise + truth, refined.height_m)
    ]
    assert slopes[1] < 0.3 * slopes[0]


def test_slow_errors_of_light_do_not_bend_known_ground():
    """With a mean over 1 m instead of 0.1 m, the error is 0.20 mm; without drift of the light it is 0.06 mm."""
    truth = bump(0.1, 0.1) + bump(-0.2, 0.0, 0.01, 0.04)
    measured = HeightMap(GRID, truth, np.full(GRID.shape, 0.03), np.full(GRID.shape, MEASURED, np.uint8))
    drift = np.exp(0.2 * np.sin(np.linspace(0, 4 * np.pi, 640, dtype=np.float32)))
    views = [replace(view, picture=view.picture * drift) for view in (photo(truth, azimuth) for azimuth in ALL)]
    refined = refine(measured, views, NO_MASK, NOTHING, PARAMETERS)
    assert (refined.height_m - truth)[INNER].std() < 0.15e-3


def test_photos_of_another_scene_are_refused():
    views = [photo(bump(-0.2, 0.2), "30"), photo(bump(0.25, -0.2, -0.03), "180")]
    with pytest.raises(ReconstructionError, match="03_A_off_30_L_0256"):
        refine(level(), views, NO_MASK, NOTHING, PARAMETERS)


def test_photos_that_contradict_a_scan_are_refused_and_others_are_used(caplog):
    truth = bump(0.1, 0.1) + bump(-0.2, 0.0, 0.01, 0.04)
    scanned = HeightMap(GRID, truth, np.full(GRID.shape, 1e-4), np.full(GRID.shape, MEASURED, np.uint8))
    views = [photo(truth, "30"), photo(bump(0.25, -0.2, -0.03), "180"), photo(truth, "270")]
    refine(scanned, views, NO_MASK, NOTHING, PARAMETERS)
    assert [record.getMessage().split(":")[0] for record in caplog.records] == ["03_A_off_180_L_0256"]


def test_a_single_photo_without_shadows_of_rocks_is_refused():
    with pytest.raises(ReconstructionError):
        inferred(bump(), ("30",))


def test_shadows_of_rocks_show_whether_a_photo_is_of_the_scene():
    truth = bump()
    here, elsewhere = rocks((-0.3, 0.2), (0.25, -0.25), (0.3, 0.3)), rocks((0.0, 0.35), (-0.3, -0.3), (0.3, 0.0))
    caster = NumpyCaster(here.vertices, here.faces)
    centres = GRID.centres()
    masked = np.zeros(GRID.shape, bool)
    for place in ((-0.3, 0.2), (0.25, -0.25), (0.3, 0.3)):
        masked |= (np.abs(centres - place) < 0.06).all(axis=-1)
    refined = refine(level(), [photo(truth, "30", rocky=here)], masked, caster, PARAMETERS)
    free = INNER & ~masked
    assert np.corrcoef(refined.height_m[free], truth[free])[0, 1] > 0.7
    with pytest.raises(ReconstructionError):
        refine(level(), [photo(truth, "30", rocky=elsewhere)], masked, caster, PARAMETERS)


def test_dark_photos_are_refused():
    views = [replace(photo(bump(), azimuth), picture=np.full((400, 640), np.nan, np.float32)) for azimuth in PAIR]
    with pytest.raises(ReconstructionError):
        refine(level(), views, NO_MASK, NOTHING, PARAMETERS)
