"""Recovery of albedo and lamp brightness from photos."""

from dataclasses import replace

import numpy as np
import pytest

from polarsim.photo import NO_ROCK
from polarsim.render.fitting.fit import fit
from polarsim.render.lamps import ROVER
from polarsim.render.options import FittingOptions, RenderOptions
from polarsim.run_files.materials import rock_of_vertex
from tests.render.fitting.conftest import LAMPS

from .conftest import GAINS, SEEN, UNSEEN, pattern, sandbox, shoot


@pytest.fixture(scope="module")
def found(studio, engine):
    return fit(studio.samples, LAMPS, studio.mesh, ["lambert"], engine, studio.options)


def test_the_fit_recovers_albedo_from_noisy_photos(studio, found):
    seen = found.looks >= 2
    assert seen.sum() > 800
    error = found.models["lambert"].albedo[seen] / studio.albedo[seen] - 1
    assert np.median(np.abs(error)) < 0.02  # the albedo varies by 0.25


def test_the_fit_recovers_lamp_brightness(found):
    lamps = found.models["lambert"].lamps
    assert set(lamps) == set(GAINS)
    ratios = np.array([lamps[name] / GAINS[name] for name in GAINS])
    np.testing.assert_allclose(ratios, 1, rtol=0.03)


def test_an_invisible_rock_gets_the_mean_of_the_other_rocks(studio, found):
    rocks = found.models["lambert"].rocks
    true = float(studio.albedo[rock_of_vertex(studio.mesh) == SEEN].mean())
    assert rocks[SEEN] == pytest.approx(true, rel=0.05)
    assert rocks[UNSEEN] == pytest.approx(rocks[SEEN], rel=1e-6)
    unseen = found.models["lambert"].albedo[rock_of_vertex(studio.mesh) == UNSEEN]
    np.testing.assert_allclose(unseen, rocks[UNSEEN], rtol=0.02)


def test_fitted_albedo_reduces_the_error_on_the_held_out_azimuth(found):
    check = found.models["lambert"].check
    assert check["azimuth"] == "30"
    for scale in ("pixels", "texels"):
        assert check[scale]["fitted"]["median_stops"] < 0.5 * check[scale]["constant_albedo"]["median_stops"]


def test_photos_of_the_held_out_azimuth_affect_only_the_brightness_of_its_lamp(studio, engine, found):
    without = studio.samples.part(studio.samples.lamp != LAMPS.index("30"))
    again = fit(without, LAMPS, studio.mesh, ["lambert"], engine, studio.options)
    assert again.models["lambert"].check == {}
    assert again.azimuths == found.azimuths == ("180", "270", ROVER)
    assert "30" not in again.models["lambert"].lamps
    np.testing.assert_array_equal(found.looks, again.looks)
    np.testing.assert_array_equal(found.models["lambert"].albedo, again.models["lambert"].albedo)


def test_a_fit_without_samples_returns_none(studio, engine):
    nothing = studio.samples.part(np.zeros(len(studio.samples), bool))
    assert fit(nothing, LAMPS, studio.mesh, ["lambert"], engine, studio.options) is None


def test_invisible_vertices_get_the_mean_of_their_object(studio, engine):
    half = studio.samples.part(studio.samples.point[:, 0] > 0)
    albedo = fit(half, LAMPS, studio.mesh, ["lambert"], engine, studio.options).models["lambert"].albedo
    far = studio.mesh.vertices[:, 0] < -0.6
    far &= rock_of_vertex(studio.mesh) == NO_ROCK
    np.testing.assert_allclose(albedo[far], np.median(albedo[far]), rtol=0.1)
    assert np.median(albedo[far]) == pytest.approx(1, abs=0.1)


def test_a_shadow_missing_in_the_meshes_has_little_effect(studio, engine, found):
    shaded = (studio.samples.lamp == LAMPS.index("180")) & (studio.samples.point[:, 0] > 0.4)
    rate = np.where(shaded, studio.samples.rate / 20, studio.samples.rate)
    assert 0.02 < shaded.mean() < 0.2
    spoilt = replace(studio.samples, rate=rate)
    dirty = fit(spoilt, LAMPS, studio.mesh, ["lambert"], engine, studio.options)
    seen = (found.looks >= 4) & (studio.mesh.vertices[:, 0] > 0.45)
    error = dirty.models["lambert"].albedo[seen] / studio.albedo[seen] - 1
    assert np.median(np.abs(error)) < 0.03
    assert dirty.models["lambert"].lamps["180"] == pytest.approx(GAINS["180"], rel=0.05)


def test_the_fit_recovers_parameters_independently_of_albedo(engine):
    mesh = sandbox()
    options = RenderOptions(
        models=("hapke",), walls=False, bounce=0, falloff=True, skirt_m=0,
        fitting=FittingOptions(parameters={"hapke": ("theta_bar_deg",)}),
    )  # fmt: skip
    samples = shoot(mesh, pattern(mesh), options)
    start = options.parameters("hapke")
    wrong = options.with_default(hapke=start.model_copy(update={"theta_bar_deg": 12.0}))
    parameters = fit(samples, LAMPS, mesh, ["hapke"], engine, wrong).models["hapke"].parameters
    assert parameters["theta_bar_deg"] == pytest.approx(23.4, abs=1.5)
    assert parameters["w"] == start.w
