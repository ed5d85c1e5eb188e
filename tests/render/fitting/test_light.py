"""Recovery of the light fields of lamps from photo over twin."""

from dataclasses import replace

import numpy as np
import pytest

from polarsim.errors import FormatError
from polarsim.geometry.light_field import EVEN, POWERS, REACH_M, relative_irradiance
from polarsim.render.fitting.light import PhotoOverTwin, fit_field, light_fields
from polarsim.render.fitting.samples import Setting, with_light_fields
from polarsim.render.lamps import lamp_names
from polarsim.run_files.light_fields import read_light_fields, sun_coefficients, write_light_fields
from polarsim.site import polar

SUNS, LAMPS = polar().suns, lamp_names(polar())
TRUE = tuple(np.where(np.array([i + j for i, j in POWERS]) == 1, 0.6, -0.3).tolist())
OTHER = tuple(-value for value in TRUE)


def brightness(seed, field=TRUE, noise=0.1, shaded=0.0, count=3000):
    """Photo over twin under a lamp with a field, in two views of different gain; a share of the points is dark."""
    rng = np.random.default_rng(seed)
    point = rng.uniform(-1.9, 1.9, (count, 2))
    view = rng.integers(0, 2, count)
    ratio = np.log(relative_irradiance(field, point)) + 3 * view + noise * rng.standard_normal(count)
    ratio[rng.random(count) < shaded] -= 3
    falloff = 2 * np.log(4 / np.linalg.norm(point - [3.6, 1.4], axis=1))
    return PhotoOverTwin(point, ratio, falloff, view, ("A", "C"))


def seen(**fields):
    return {int(name[1:]): {"30": brightness(int(name[1:]), field)} for name, field in fields.items()}


def test_a_field_is_recovered_in_spite_of_gains_noise_and_shadows():
    found = fit_field([brightness(1), brightness(2, shaded=0.15)])
    grid = np.random.default_rng(5).uniform(-1.8, 1.8, (500, 2))
    error = np.log(relative_irradiance(found, grid) / relative_irradiance(TRUE, grid))
    assert np.median(np.abs(error - np.median(error))) < 0.03
    assert np.ptp(np.log(relative_irradiance(TRUE, grid))) > 1


def test_fields_are_shared_and_only_that_of_the_held_out_azimuth_is_without_the_photos_of_the_terrain():
    alike = light_fields(seen(t1=TRUE, t2=TRUE, t3=TRUE), {1, 2, 3}, set(), SUNS)
    assert alike[1]["30"].coefficients == alike[2]["30"].coefficients
    assert (alike[1]["30"].terrains, alike[1]["30"].positions) == ((1, 2, 3), ("A", "C"))
    others = {f"t{terrain}": TRUE for terrain in (2, 3, 4, 5)}
    held = light_fields(seen(t1=OTHER, **others), {1, 2, 3, 4, 5}, {"30"}, SUNS)
    assert (held[1]["30"].terrains, held[1]["30"].positions) == ((2, 3, 4, 5), ())
    same = light_fields(seen(t1=TRUE, **others), {1, 2, 3, 4, 5}, {"30"}, SUNS)
    assert held[1]["30"].coefficients == same[1]["30"].coefficients
    assert held[2]["30"].coefficients != held[1]["30"].coefficients
    assert held[1]["30"].held_out_stops["field"] > 5 * held[2]["30"].held_out_stops["field"]


def test_light_is_even_if_a_field_explains_left_out_terrains_no_better():
    parts = {}
    for terrain, slope in ((1, 0.3), (2, -0.3)):  # lamps with opposite aims
        plain = brightness(terrain, EVEN)
        parts[terrain] = {"30": replace(plain, ratio=plain.ratio + slope * plain.point[:, 0])}
    found = light_fields(parts, {1, 2}, set(), SUNS)
    assert found[1]["30"].coefficients == found[2]["30"].coefficients == EVEN
    assert found[1]["30"].held_out_stops["field"] > found[1]["30"].held_out_stops["even"]
    assert light_fields(seen(t1=TRUE, t2=TRUE), {1, 2}, set(), SUNS)[1]["30"].held_out_stops["field"] < 0.1


def test_lamps_without_photos_have_even_light():
    found = sun_coefficients(light_fields(seen(t1=TRUE, t2=TRUE), {1, 2}, set(), SUNS)[1], SUNS)
    assert set(found) == set(SUNS)
    assert [azimuth for azimuth, field in found.items() if field != EVEN] == ["30"]


def test_fields_of_a_terrain_read_back(tmp_path):
    fields = {"principled": light_fields(seen(t1=TRUE, t2=TRUE), {1, 2}, set(), SUNS)[1]}
    write_light_fields(tmp_path / "light.json", fields)
    assert read_light_fields(tmp_path / "light.json") == fields
    (tmp_path / "light.json").write_text('{"principled": {"30": {"coefficients": ["a"], "terrains": []}}}')
    with pytest.raises(FormatError, match=r"light\.json"):
        read_light_fields(tmp_path / "light.json")


def test_a_single_terrain_has_no_field_of_the_held_out_azimuth():
    assert light_fields(seen(t1=TRUE), {1}, {"30"}, SUNS) == {1: {}}
    only = light_fields(seen(t1=TRUE), {1}, {"180"}, SUNS)[1]["30"]
    assert (only.terrains, only.held_out_stops) == ((1,), {})


def test_the_order_of_terrains_has_no_effect():
    parts = seen(t1=TRUE, t2=OTHER, t3=TRUE)
    assert light_fields(parts, {1, 2, 3}, {"30"}, SUNS) == light_fields(
        dict(reversed(parts.items())), {3, 2, 1}, {"30"}, SUNS
    )


@pytest.mark.parametrize("falloff", [False, True])
def test_samples_under_a_field_have_the_radiance_of_the_field_whatever_the_falloff(studio, engine, falloff):
    options = studio.options.model_copy(update={"falloff": falloff})
    setting = Setting("lambert", options.parameters("lambert"), engine, options)
    even = Setting("lambert", setting.parameters, engine, options.model_copy(update={"falloff": False}))
    under = with_light_fields(studio.samples, {"180": TRUE}, LAMPS, REACH_M)
    chosen = studio.samples.lamp == LAMPS.index("180")
    expected = even.radiance(studio.samples) * np.where(chosen, relative_irradiance(TRUE, studio.samples.point), 1)
    np.testing.assert_allclose(setting.radiance(under)[chosen], expected[chosen], rtol=1e-5)
    np.testing.assert_array_equal(setting.radiance(under)[~chosen], setting.radiance(studio.samples)[~chosen])
    assert chosen.any()
    assert LAMPS[: len(SUNS)] == SUNS
