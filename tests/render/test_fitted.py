"""Twins of a run with materials fitted to photos."""

import json

import numpy as np
import pandas as pd
import pytest

from polarsim.config import parse_config
from polarsim.errors import FormatError
from polarsim.formats import png
from polarsim.geometry.light_field import relative_irradiance
from polarsim.paths import RunPaths
from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL, PhotoKey
from polarsim.render.fitting import light, samples
from polarsim.render.fitting.exposures import Linear, read_published_photo
from polarsim.render.fitting.fit import fit_materials
from polarsim.render.fitting.light import fit_light
from polarsim.render.gain import with_fit, with_fitted_intensities
from polarsim.render.lamps import ROVER, Lamp
from polarsim.render.options import OF_FITTED, FittingOptions, RenderOptions
from polarsim.render.parameters import LambertParameters
from polarsim.run_files.light_fields import FittedField, read_light_fields, write_light_fields
from polarsim.run_files.materials import FittedMaterial, FittedMaterials, read_materials, write_materials
from polarsim.run_files.scene import read_terrain
from polarsim.site import polar
from tests.support.polar_survey import SANDBOX

from .conftest import render_into

OPTIONS = RenderOptions(
    models=("lambert",), walls=False, bounce=0, fitting=FittingOptions(parameters={}, held_out="no")
)
FITTED_OPTIONS = OPTIONS.model_copy(update={"materials_from_photos": True})
KEYS = [PhotoKey.parse(f"01_A_{name}_L_{ms:04d}") for name in ("off_30", "off_180", "on_no") for ms in (32, 128, 512)]
LIT = 60  # DN above black


def fit_of(parameters, **lamps):
    return FittedMaterial(parameters, lamps, {}, np.ones(4, np.float32))


def twins_of(folders, out, options=OPTIONS, materials=None):
    render_into(folders, {"lambert": folders / out}, KEYS, options, materials=materials)
    return {PhotoKey.parse(path.stem): path for path in sorted((folders / out).glob("*.png"))}


def index(folders, paths):
    path = folders / "photos.parquet"
    pd.DataFrame({"key": list(map(str, paths)), "path": list(map(str, paths.values()))}).to_parquet(path)
    return path


def fitted(folders, photos, out="materials", threads=1, options=OPTIONS):
    fit_materials(
        site=polar(), terrain=1, cameras=folders / "cameras", meshes=folders / "meshes", photos=photos,
        domains=["lambert"], light=None, materials=folders / out, options=options, threads=threads,
    )  # fmt: skip
    return folders / out


@pytest.fixture(autouse=True)
def _small_pictures(monkeypatch):
    monkeypatch.setattr(samples, "STEP_PX", 1)
    monkeypatch.setattr(samples, "BORDER_PX", 1)


@pytest.fixture
def photographed(folders):
    """Photos of a terrain with a rock twice as bright as the ground and a lamp twice as bright as the first."""
    mesh = read_terrain(folders / "meshes", 1, SANDBOX)
    albedo = np.where(np.arange(len(mesh.vertices)) < 4, 1.0, 2.0)
    lamps = {"30": 60.0, "180": 120.0, "rover": 90.0}
    fit = FittedMaterial({"albedo": 0.2}, lamps, {1: 2.0}, albedo.astype(np.float32))
    truth = FittedMaterials({"lambert": fit}, np.ones(len(albedo), int))
    write_materials(folders / "truth", mesh, truth)
    return twins_of(folders, "photos", FITTED_OPTIONS, materials=folders / "truth")


def test_twins_with_fitted_materials_reproduce_the_photos(folders, photographed):
    materials = fitted(folders, index(folders, photographed))
    again = twins_of(folders, "again", FITTED_OPTIONS, materials=materials)
    plain = twins_of(folders, "plain")
    differ = {}
    for key, path in photographed.items():
        photo, twin, constant = (
            png.read_png(one).astype(float) - BLACK_LEVEL for one in (path, again[key], plain[key])
        )
        lit = (photo > LIT) & (photo < WHITE_LEVEL - BLACK_LEVEL) & (constant > 0)
        if not lit.any():  # exposure too short for the rover light
            continue
        differ[key] = [np.median(np.abs(np.log2(np.maximum(one[lit], 1) / photo[lit]))) for one in (twin, constant)]
    with_fit_stops, without = np.array(list(differ.values())).T
    assert len(differ) >= 6
    assert with_fit_stops.max() < 0.02
    sidecar = json.loads(again[KEYS[0]].with_suffix(".json").read_text())
    assert "materials" in sidecar["sources"]
    assert "materials" not in json.loads(plain[KEYS[0]].with_suffix(".json").read_text())["sources"]
    assert without.max() > 0.5


def test_a_fit_has_the_same_bytes_with_one_thread_and_two(folders, photographed):
    photos = index(folders, photographed)
    one, two = fitted(folders, photos, "one"), fitted(folders, photos, "two", threads=2)
    for path in one.iterdir():
        assert path.read_bytes() == (two / path.name).read_bytes()


@pytest.mark.parametrize("photos", ["no table", "no photo", "dark photos"])
def test_without_usable_photos_materials_are_constant_with_a_warning(folders, photos, caplog):
    paths = {}
    if photos == "dark photos":
        paths = {key: folders / "dark" / f"{key}.png" for key in KEYS}
        for path in paths.values():
            png.write_png(path, np.full((140, 200), BLACK_LEVEL, np.uint16))
    materials = fitted(folders, None if photos == "no table" else index(folders, paths))
    assert [record.levelname for record in caplog.records].count("WARNING") >= 1
    assert read_materials(materials, read_terrain(folders / "meshes", 1, SANDBOX)).models == {}
    plain, with_nothing = twins_of(folders, "plain"), twins_of(folders, "nothing", materials=materials)
    for key, path in plain.items():
        assert path.read_bytes() == with_nothing[key].read_bytes()


def test_a_gain_in_the_options_has_priority_over_the_fit_and_unknown_parameters_are_rejected():
    found = FittedMaterials({"lambert": fit_of({"albedo": 0.3}, **{"30": 2.0, "rover": 9.0})}, np.ones(4))
    options, albedo = with_fit(RenderOptions(gain={"lambert": 5}), found)
    assert options.gain["lambert"] == 5
    assert with_fit(RenderOptions(), found)[0].gain["lambert"] == 2
    assert options.parameters("lambert") == LambertParameters(albedo=0.3)
    assert list(albedo) == ["lambert"]
    unknown = FittedMaterials({"lambert": fit_of({"w": 0.3}, **{"30": 2.0})}, np.ones(4))
    with pytest.raises(FormatError):
        with_fit(RenderOptions(), unknown)


def test_fitted_intensities_are_relative_to_the_median_sun_lamp():
    lamps = {
        name: Lamp(np.zeros(3), intensity) for name, intensity in (("30", 1), ("180", 1), ("350", 1), (ROVER, 0.5))
    }
    found = FittedMaterials({"lambert": fit_of({}, **{"30": 2.0, "180": 12.0, "270": 3.0, "rover": 6.0})}, np.ones(4))
    active_lamps = with_fitted_intensities(lamps, found, "lambert")
    brightness = {name: lamp.intensity for name, lamp in active_lamps.items()}
    assert brightness == pytest.approx({"30": 2 / 3, "180": 4, "350": 1, ROVER: 1})  # there is no photo of 350
    assert with_fitted_intensities(lamps, None, "lambert") is lamps
    assert with_fitted_intensities(lamps, found, "hapke") is lamps


def test_the_fitted_domain_stands_beside_models_whose_twins_keep_their_bytes(folders, caplog):
    options = OPTIONS.model_copy(update={"models": ("principled", "fitted"), "bounce": 0.01})
    paths = {"principled": folders / "beside", "fitted": folders / "fitted"}
    with caplog.at_level("INFO", "polarsim.render"):
        render_into(folders, paths, KEYS, options)
    assert sum("no fit to photos" in record.message for record in caplog.records) == 1
    render_into(folders, {"principled": folders / "alone"}, KEYS, options, labels="labels_alone")
    files = sorted(path.name for path in paths["fitted"].iterdir())
    assert files == sorted(path.name for path in paths["principled"].iterdir())
    for name in files:
        assert (folders / "beside" / name).read_bytes() == (folders / "alone" / name).read_bytes()
    for label in ("boxes", "instances"):
        for path in (folders / "labels" / label).iterdir():
            assert path.read_bytes() == (folders / "labels_alone" / label / path.name).read_bytes()
    beside, soft = (png.read_png(folder / f"{KEYS[1]}.png").astype(float) for folder in paths.values())
    assert (np.abs(beside - soft) > 5).mean() > 0.1  # penumbrae, vignetting, falloff of the rover light
    sidecar = json.loads((paths["fitted"] / f"{KEYS[1]}.json").read_text())
    assert (sidecar["model"], sidecar["lamps"]["30"]["radius_m"]) == ("principled", 0.045)


def test_light_fields_apply_to_fitted_twins_only(folders):
    field = FittedField(coefficients=(1.0, *[0.0] * 8), terrains=(3,), positions=("A",))
    write_light_fields(folders / "light.json", {"fitted": {"30": field}})
    options = OPTIONS.model_copy(update={"models": ("principled", "fitted")})
    paths = {"principled": folders / "plain", "fitted": folders / "fitted"}
    render_into(folders, paths, KEYS, options, light=folders / "light.json")
    plain, fitted = (json.loads((folder / f"{KEYS[1]}.json").read_text()) for folder in paths.values())
    assert fitted["lamps"]["30"]["light_field"] == list(field.coefficients)
    assert "light_field" not in plain["lamps"]["30"]
    assert ("light" in fitted["sources"], "light" in plain["sources"]) == (True, False)


@pytest.mark.parametrize("name", OF_FITTED)
def test_options_that_a_run_sets_to_their_default_are_kept_in_fitted_twins(name):
    default = RenderOptions.model_fields[name].default
    assert default != OF_FITTED[name]
    source, models = {"kind": "analog", "root": "data"}, ["hapke", "fitted"]
    plain, kept = (
        parse_config({"source": source, "render": {"models": models} | of_run}) for of_run in ({}, {name: default})
    )
    for config, expected in ((plain, OF_FITTED), (kept, OF_FITTED | {name: default})):
        in_job = RenderOptions(**RunPaths(config).options("render"))
        assert in_job == config.render
        assert {key: getattr(in_job.as_fitted(), key) for key in OF_FITTED} == expected
    assert plain.digest() != kept.digest()
    without = [parse_config({"source": source, "render": of_run}) for of_run in ({}, {name: default})]
    assert without[0].digest() == without[1].digest()


def test_options_of_a_run_take_precedence_over_those_of_fitted_twins():
    changed = RenderOptions(lamp_radius_m=0.02, blur_px=1.0, bounces=1).as_fitted()
    assert (changed.lamp_radius_m, changed.blur_px, changed.bounces, changed.vignetting) == (0.02, 1.0, 1, True)
    assert RenderOptions(models=("fitted", "hapke")).fitted_domains == ("fitted",)
    assert RenderOptions(models=("lambert", "hapke"), materials_from_photos=True).fitted_domains == ("lambert", "hapke")
    with pytest.raises(ValueError, match="same"):
        RenderOptions(models=("fitted", "principled"), materials_from_photos=True)


def light_of(folders, photos):
    fit_light(
        site=polar(), cameras={1: folders / "cameras"}, meshes={1: folders / "meshes"}, photos=[photos],
        domains=["lambert"], light={1: folders / "light.json"}, options=FITTED_OPTIONS, threads=1,
    )  # fmt: skip
    return read_light_fields(folders / "light.json")


def test_light_of_lamps_without_beam_is_even(folders, photographed, monkeypatch):
    monkeypatch.setattr(light, "_SCALE", 1.0)
    monkeypatch.setattr(light, "_MIN_SAMPLES", 100)
    ground_only = {key: path for key, path in photographed.items() if key.light == "off"}
    fields = light_of(folders, index(folders, ground_only))["lambert"]
    assert set(fields) == {"30", "180"}
    at = np.random.default_rng(1).uniform(-0.4, 0.4, (50, 2))  # ground of the test scene
    for field in fields.values():
        assert np.abs(np.log2(relative_irradiance(field.coefficients, at))).max() < 0.05


def test_without_usable_photos_no_light_field_is_written_with_a_warning(folders, caplog):
    assert light_of(folders, index(folders, {})) in ({}, {"lambert": {}})
    assert [record.levelname for record in caplog.records].count("WARNING") == 1


def test_published_photos_have_the_upper_8_of_12_bits(tmp_path):
    grey = np.arange(200, dtype=np.uint8).reshape(10, 20)
    png.write_png(tmp_path / "grey.png", grey)
    png.write_png(tmp_path / "colour.png", np.repeat(grey[..., None], 3, axis=-1))
    png.write_png(tmp_path / "raw.png", grey.astype(np.uint16))
    for name in ("grey.png", "colour.png"):
        np.testing.assert_array_equal(read_published_photo(tmp_path / name, (20, 10)), grey.astype(int) * 16)
    for name, size in (("raw.png", (20, 10)), ("grey.png", (10, 20))):
        with pytest.raises(FormatError, match=name):
            read_published_photo(tmp_path / name, size)


def test_a_smaller_linear_image_is_the_mean_and_undefined_pixels_stay_undefined(lens):
    small = lens.scaled(0.5)
    rate = np.random.default_rng(0).random(lens.shape).astype(np.float32)
    variance = np.full(lens.shape, 4, np.float32)
    variance[2, 2] = np.inf
    found = Linear(rate, variance).resized(small)
    height, width = small.shape
    expected = rate.reshape(height, 2, width, 2).mean(axis=(1, 3))
    np.testing.assert_allclose(found.rate, expected, rtol=1e-5)
    assert np.isinf(found.variance[1, 1])
    np.testing.assert_allclose(found.variance[np.isfinite(found.variance)], 1, rtol=1e-5)
    assert np.isinf(found.variance).sum() == 1
