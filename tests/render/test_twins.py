import logging
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from polarsim.formats import png
from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL, PhotoKey
from polarsim.render.gain import default_gain, gain_ratios
from polarsim.render.optics import spread, vignette
from polarsim.render.options import MODELS, RenderOptions
from polarsim.run_files.rigs import SURVEYED, UNCERTAIN_LABELS, read_localised, write_localised
from polarsim.site import polar
from tests.support.polar_survey import SURVEYED_LEFT, lamp_position

from .conftest import render_into

SETS = ("01_A_off_30_L", "01_A_on_30_L", "01_A_off_180_R")
KEYS = [PhotoKey.parse(f"{name}_{ms:04d}") for name in SETS for ms in (64, 128, 256)]
OPTIONS = RenderOptions(walls=False, bounce=0)


def render(folders, out, keys=KEYS, model="hapke", options=OPTIONS, **others):
    render_into(folders, {model: folders / out}, keys, options, **others)
    return {path.stem: png.read_png(path).astype(int) for path in sorted((folders / out).glob("*.png"))}


def test_every_key_has_a_12_bit_twin_that_doubles_with_the_exposure_and_to_which_the_rover_light_adds(folders, lens):
    twins = render(folders, "twins")
    assert sorted(twins) == sorted(map(str, KEYS))
    for twin in twins.values():
        assert twin.shape == lens.shape
        assert twin.min() == BLACK_LEVEL
        assert 100 < twin.max() <= WHITE_LEVEL
    short, long = (twins[f"01_A_off_30_L_{ms:04d}"] - BLACK_LEVEL for ms in (64, 128))
    free = long < WHITE_LEVEL - BLACK_LEVEL
    assert (short > 0).sum() > 5000
    assert np.abs(long - 2 * short)[free].max() <= 1  # rounding
    assert (twins["01_A_on_30_L_0128"] >= twins["01_A_off_30_L_0128"]).all()
    assert (twins["01_A_on_30_L_0128"] > twins["01_A_off_30_L_0128"]).mean() > 0.1


def test_models_rendered_together_equal_separate_renderings(folders):
    both = {model: folders / "both" / model for model in ("hapke", "principled")}
    render_into(folders, both, KEYS, OPTIONS)
    for model, together in both.items():
        alone = render(folders, f"{model}_alone", model=model)
        assert sorted(alone) == sorted(path.stem for path in together.glob("*.png"))
        for key, twin in alone.items():
            np.testing.assert_array_equal(png.read_png(together / f"{key}.png"), twin)


def test_terrain_13_has_no_walls(folders):
    """Terrain 1 has nominal walls, which are visible; the walls of terrain 13 were not surveyed."""
    for mesh in (folders / "meshes").iterdir():
        mesh.rename(mesh.with_name(mesh.name.replace("terrain01", "terrain13")))
    keys = [PhotoKey.parse("13_A_off_30_L_0128")]
    walled = OPTIONS.model_copy(update={"walls": True})

    def twin(out, options):
        return render(folders, out, keys, options=options, terrain=13)["13_A_off_30_L_0128"]

    np.testing.assert_array_equal(twin("walled", walled), twin("open", OPTIONS))


def test_the_same_bytes_with_one_thread_and_two(folders):
    faults = {"noise": True, "vignetting": True, "blur_px": 0.6, "bloom": 0.02, "lens_flare": 0.005}
    options = OPTIONS.model_copy(update=faults)
    render(folders, "one", options=options)
    render(folders, "two", options=options, threads=2)
    for path in (folders / "one").iterdir():
        assert path.read_bytes() == (folders / "two" / path.name).read_bytes()


def test_vignetting_and_blur_are_applied_once(folders, lens):
    plain = OPTIONS.model_copy(update={"gain": {"hapke": 20.0}})
    faulty = plain.model_copy(update={"vignetting": True, "blur_px": 1.5})
    sharp, seen = render(folders, "plain", options=plain), render(folders, "faulty", options=faulty)
    for key, twin in seen.items():
        assert sharp[key].max() < WHITE_LEVEL  # no pixel is clipped
        signal = (sharp[key] - BLACK_LEVEL).astype(np.float32)
        expected = spread(signal, faulty) * vignette(lens)
        assert np.abs(twin - BLACK_LEVEL - expected).max() < 1.5  # both are rounded
        assert np.abs(signal - expected).max() > 0.1 * signal.max()


def test_level_ground_at_the_centre_has_the_stated_brightness(lens):
    for model in MODELS:
        options = RenderOptions(falloff=False)
        to_lamp, to_viewer = lamp_position("30"), SURVEYED_LEFT["A"]
        from polarsim.render.brdf import reflectance

        unit = [v[None] / np.linalg.norm(v) for v in (np.array([0, 0, 1.0]), to_lamp, to_viewer)]
        radiance = reflectance(options.parameters(model), *unit)[0] * unit[1][0, 2]
        assert default_gain(model, options, polar()) * radiance == pytest.approx(3.0)  # DN per ms


def photo_table(folders, twins, factor):
    """Write photos with `factor` times the brightness of twins, with grey rims and an invalid file."""
    rows = []
    for key, twin in twins.items():
        path = folders / "photos" / f"{key}.png"
        photo = np.clip(BLACK_LEVEL + factor * (twin - BLACK_LEVEL), 0, WHITE_LEVEL).round().astype(np.uint16)
        photo[:14] = 3000
        path.parent.mkdir(exist_ok=True)
        png.write_png(path, photo)
        rows.append({"key": key, "path": str(path)})
    (folders / "photos" / "01_A_off_180_R_0256.png").write_bytes(b"no picture")
    table = folders / "photos.parquet"
    pd.DataFrame([*rows, {"key": "01_A_off_270_L_0256", "path": str(folders / "gone.png")}]).to_parquet(table)
    return table


def test_the_gain_is_calibrated_on_photos(folders):
    plain = render(folders, "plain", options=OPTIONS.model_copy(update={"gain": {"hapke": 60.0}}))
    table = photo_table(folders, plain, 0.8)
    matched = render(folders, "matched", photos=table)
    expected = render(folders, "expected", options=OPTIONS.model_copy(update={"gain": {"hapke": 48.0}}))
    for key, twin in matched.items():
        assert np.abs(twin - expected[key]).max() <= 0.005 * WHITE_LEVEL


def test_a_subset_of_twins_equals_those_of_the_full_set(folders):
    table = photo_table(folders, render(folders, "plain"), 0.8)
    whole = render(folders, "whole", photos=table)
    for chosen in (KEYS[:1], KEYS[3:5], KEYS[6:]):  # of the calibrated view and of the second view
        out = f"some_{chosen[0]}"
        render(folders, out, labels=out, only=chosen, photos=table)
        assert sorted(path.stem for path in (folders / out).glob("*.png")) == sorted(map(str, chosen))
        for key in chosen:
            np.testing.assert_array_equal(png.read_png(folders / out / f"{key}.png"), whole[str(key)])
        labels = pd.read_parquet(folders / out / "table.parquet")
        assert set(labels["key"]) == set(map(str, chosen))


def test_an_empty_selection_writes_folders_and_an_empty_table(folders):
    """Split by position a terrain may have no test photo; the gap's twins are of test photos."""
    render(folders, "none", only=set())
    for folder in (folders / "none", folders / "labels/boxes", folders / "labels/instances"):
        assert folder.is_dir()
        assert not list(folder.glob("0*"))
    assert pd.read_parquet(folders / "labels/table.parquet").empty
    assert (folders / "labels/coco.json").is_file()


def test_lamps_can_be_read_from_a_separate_folder(folders):
    from polarsim.run_files.lamps import write_suns

    write_suns(folders / "moved", {"30": np.array([-3.0, 1.0, 0.8])})
    twins, moved = render(folders, "twins"), render(folders, "moved_twins", lamps=folders / "moved")
    assert (moved["01_A_off_30_L_0256"] != twins["01_A_off_30_L_0256"]).mean() > 0.1
    np.testing.assert_array_equal(moved["01_A_off_180_R_0256"], twins["01_A_off_180_R_0256"])


def test_unusable_photos_do_not_change_the_gain(folders, lens):
    dark = np.full(lens.shape, BLACK_LEVEL, np.uint16)
    assert not len(gain_ratios(dark, np.ones(dark.shape, np.float32), 256))
    assert not len(gain_ratios(dark + 500, np.zeros(dark.shape, np.float32), 256))


@pytest.mark.parametrize("method", [None, UNCERTAIN_LABELS, SURVEYED])
def test_positions_without_pose_or_with_an_unproven_pose_have_neither_twins_nor_labels(folders, caplog, method):
    path = folders / "cameras" / "PosA.json"
    if method:
        write_localised(path, replace(read_localised(path), method=method))
    rendered = [] if method else [str(KEYS[0])]
    with caplog.at_level(logging.WARNING):
        assert list(render(folders, "twins", [KEYS[0], PhotoKey.parse("01_B_off_30_L_0256")])) == rendered
    assert [file.stem for file in (folders / "labels" / "boxes").iterdir()] == rendered
    assert set(pd.read_parquet(folders / "labels" / "table.parquet")["key"]) == set(rendered)
    assert (str(path) in caplog.text) == bool(method)
    assert "PosB.json" in caplog.text
