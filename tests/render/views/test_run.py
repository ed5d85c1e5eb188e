"""Folder of labelled images: content, and reuse of existing images."""

import json
import shutil
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import yaml

from polarsim.errors import ConfigError
from polarsim.formats import png, tables, yolo
from polarsim.photo import BLACK_LEVEL, BOX_CLASSES
from polarsim.render.ground_truth import boxes_of_ids
from polarsim.render.scene import Scene
from polarsim.render.views import run
from polarsim.render.views.folder import divided
from polarsim.render.views.options import AutoExposure
from polarsim.render.views.plan import plan
from polarsim.render.views.run import auto_exposure, render_units, render_views
from polarsim.run_files.instances import ROCK_IDS, SHADOW_IDS

ORBIT = {"kind": "orbit", "radius_m": 1.6, "height_m": 0.9, "number": 3}
SUNS = {"kind": "sun", "azimuth_deg": [0, 140], "elevation_deg": [20]}
SIZE = (96, 64)


@pytest.fixture
def grid(views_of):
    """12 pictures: 3 cameras, 2 lights, 2 models."""
    render = {"models": ["lambert", "hapke"], "rim": False, "noise": True}
    return views_of(cameras=[ORBIT], lights=[SUNS], render=render)


def files(folder):
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_every_image_has_labels_and_a_row_in_the_listings(tmp_path, grid, tone):
    assert render_views(grid, tmp_path, tone=tone) == (12, 12)
    index = tables.read_csv(tmp_path / "index.csv")
    coco = json.loads((tmp_path / "annotations.json").read_text())
    count = Counter(row["image_id"] for row in coco["annotations"])
    assert len(index) == len(coco["images"]) == 12
    for image, (_, row) in zip(coco["images"], index.iterrows(), strict=True):
        assert image["file_name"] == f"images/{row['name']}.png"
        assert png.read_photo(tmp_path / image["file_name"], SIZE).max() > BLACK_LEVEL + 50
        classes, boxes = yolo.read_boxes(tmp_path / f"labels/{row['name']}.txt", SIZE)
        ids = png.read_png(tmp_path / "instances" / row["instances"])
        found = boxes_of_ids(ids, grid.render)
        assert [BOX_CLASSES[number] for number in classes] == [kind for kind, _, _ in found]
        np.testing.assert_allclose(boxes, [box for _, _, box in found], atol=1e-3)
        assert count[image["id"]] == len(found) == row["rocks"] + row["shadows"]
    assert index["rocks"].min() == 1
    assert index["shadows"].max() == 1
    assert not [path for path in tmp_path.rglob(".*") if path.is_file()]
    assert (tmp_path / "contact.jpg").stat().st_size > 1000


def test_training_and_validation_share_no_camera_after_a_move(tmp_path, folders, views_of, tone):
    orbit = ORBIT | {"number": 7}
    views = views_of(cameras=[orbit], lights=[SUNS], render={"models": ["lambert"], "rim": False}, stereo=True)
    render_views(views, tmp_path / "made", tone=tone, scale=0.25)
    moved = tmp_path / "elsewhere"
    shutil.unpack_archive(shutil.make_archive(str(tmp_path / "set"), "zip", tmp_path / "made"), moved)
    content = yaml.safe_load((moved / "data.yaml").read_text())
    parts = {}
    for part in ("train", "val"):
        lines = (moved / content[part]).read_text().splitlines()
        assert all(line.startswith("./images/") and (moved / line).is_file() for line in lines)
        parts[part] = {Path(line).stem.split("_")[1][:-1] for line in lines}  # without L and R
    assert len(parts["train"]) == 6
    assert len(parts["val"]) == 1
    assert not parts["train"] & parts["val"]


def test_one_camera_is_divided_by_lights_and_one_image_is_in_both_parts(views_of):
    point = {"kind": "point", "position_m": [2, 0, 1], "look_at_m": [0, 0, 0]}
    parts = divided(plan(views_of(cameras=[point], lights=[SUNS], exposures_ms=[64])))
    assert {picture.light.name for picture in parts["train"]}.isdisjoint({p.light.name for p in parts["val"]})
    one = plan(views_of(cameras=[point], lights=[SUNS], exposures_ms=[64]))[:1]
    assert divided(one) == {"train": one, "val": one}


def test_an_occluded_rock_has_an_amodal_label(tmp_path, folders, views_of, tone):
    terrain = {"meshes": folders / "meshes", "terrain": 1}
    behind = {"name": "two", "terrains": [terrain, terrain | {"offset_m": [0.8, 0, 0]}]}
    camera = {"kind": "point", "position_m": [-1, 0.15, 0.3], "look_at_m": [0.4, 0, 0.1]}
    render_views(views_of(scenes=[behind], cameras=[camera]), tmp_path, tone=tone)
    coco = json.loads((tmp_path / "annotations.json").read_text())
    shares = sorted(row["visible_share"] for row in coco["annotations"] if "visible_share" in row)
    assert len(shares) == 2
    assert 0 < shares[0] < 0.9
    assert shares[1] == 1


@pytest.mark.parametrize(
    "faults", [{}, {"blur_px": 1.0, "bloom": 0.05, "veiling_glare": 0.01, "lens_flare": 0.01, "vignetting": True}]
)
def test_images_equal_those_of_a_scene(tmp_path, folders, views_of, tone, faults):
    views = views_of()
    views = views.model_copy(update={"render": views.render.model_copy(update=faults)})
    render_views(views, tmp_path, tone=tone)
    (picture,) = plan(views)
    one = Scene(folders / "meshes", 1, views.render).picture(picture.shot(views, 64.0))
    np.testing.assert_array_equal(png.read_png(tmp_path / f"images/{picture.name}.png"), one)


def test_bytes_do_not_depend_on_threads(tmp_path, grid, tone):
    for threads in (1, 3):
        render_views(grid, tmp_path / str(threads), tone=tone, threads=threads)
    assert files(tmp_path / "1") == files(tmp_path / "3")


def test_existing_images_are_not_rendered_again(tmp_path, grid, tone, monkeypatch):
    render_views(grid, tmp_path, tone=tone)
    before = files(tmp_path)
    monkeypatch.setattr(run, "render_view", None)  # a call would fail
    assert render_views(grid, tmp_path, tone=tone) == (12, 0)
    assert files(tmp_path) == before


def test_images_of_different_code_are_rendered_again(tmp_path, grid, tone, monkeypatch):
    render_views(grid, tmp_path, tone=tone)
    monkeypatch.setattr("polarsim.render.views.folder.code_digest", lambda name: f"other code of {name}")
    assert render_views(grid, tmp_path, tone=tone) == (12, 12)


def test_an_interrupted_run_resumes_with_the_same_result(tmp_path, grid, tone, monkeypatch):
    render_views(grid, tmp_path / "whole", tone=tone)
    real, calls = run.render_view, []

    def stopped(*arguments, **named):
        calls.append(1)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return real(*arguments, **named)

    monkeypatch.setattr(run, "render_view", stopped)
    with pytest.raises(KeyboardInterrupt):
        render_views(grid, tmp_path / "parts", tone=tone)
    monkeypatch.undo()
    assert len(list((tmp_path / "parts/sidecars").iterdir())) == 4  # the first camera's
    assert render_views(grid, tmp_path / "parts", tone=tone) == (12, 8)
    assert files(tmp_path / "parts") == files(tmp_path / "whole")


@pytest.mark.parametrize("kind", ["images", "labels", "sidecars"])
def test_an_image_with_a_missing_file_is_rendered_again(tmp_path, grid, tone, kind):
    render_views(grid, tmp_path, tone=tone)
    before = files(tmp_path)
    sorted((tmp_path / kind).iterdir())[5].unlink()
    assert render_views(grid, tmp_path, tone=tone) == (12, 1)
    assert files(tmp_path) == before


def test_images_of_a_changed_instance_map_are_rendered_again(tmp_path, grid, tone):
    render_views(grid, tmp_path, tone=tone)
    before = files(tmp_path)
    path = sorted((tmp_path / "instances").iterdir())[1]
    png.write_png(path, np.zeros_like(png.read_png(path)))
    assert render_views(grid, tmp_path, tone=tone) == (12, 2)
    assert files(tmp_path) == before


def test_only_changed_images_are_rendered_again(tmp_path, views_of, tone):
    render = {"models": ["lambert", "hapke"], "rim": False}
    render_views(views_of(render=render), tmp_path, tone=tone)
    brighter = render | {"materials": {"default": {"lambert": {"albedo": 0.4}}}, "models": ["lambert"]}
    assert render_views(views_of(render=brighter), tmp_path, tone=tone) == (1, 1)
    assert render_views(views_of(render=brighter, exposures_ms=[64, 128]), tmp_path, tone=tone) == (2, 1)
    more = brighter | {"models": ["lambert", "lunar_lambert"]}
    assert render_views(views_of(render=more, exposures_ms=[64, 128]), tmp_path, tone=tone) == (4, 2)


def test_limit_renders_the_first_images(tmp_path, grid, tone):
    assert render_views(grid, tmp_path, tone=tone, limit=5) == (5, 5)
    names = [picture.name for picture in plan(grid)]
    assert sorted(path.stem for path in (tmp_path / "images").iterdir()) == sorted(names[:5])
    assert render_views(grid, tmp_path, tone=tone) == (12, 7)


def test_images_of_other_views_in_the_folder_cause_a_warning(tmp_path, grid, views_of, tone, caplog):
    render_views(grid, tmp_path, tone=tone, limit=2)
    render_views(views_of(), tmp_path, tone=tone)
    assert str(tmp_path / "images") in caplog.text


def test_previews_have_eight_bits(tmp_path, views_of, tone):
    render_views(views_of(), tmp_path, tone=tone, preview=True)
    (path,) = (tmp_path / "images").iterdir()
    pixels = png.read_png(path)
    assert (pixels.dtype, pixels.ndim) == (np.uint8, 2)
    assert json.loads((tmp_path / f"sidecars/{path.stem}.json").read_text())["bits"] == 8


def test_rocks_of_several_terrains_have_different_ids(tmp_path, folders, views_of, tone):
    terrain = {"meshes": folders / "meshes", "terrain": 1}
    scene = {"name": "two", "terrains": [terrain, terrain | {"offset_m": [4, 0, 0], "heading_deg": 90}]}
    camera = {"kind": "point", "position_m": [2, -3, 3.5], "look_at_m": [2, 0, 0]}
    options = {
        "models": ["lambert"],
        "rim": False,
        "min_rock_area_px": 5,
        "min_shadow_area_px": 5,
        "min_part_area_px": 1,
    }
    render_views(views_of(scenes=[scene], cameras=[camera], render=options), tmp_path, tone=tone)
    (path,) = (tmp_path / "instances").iterdir()
    assert {ROCK_IDS + 1, ROCK_IDS + 2, SHADOW_IDS + 1, SHADOW_IDS + 2} <= set(np.unique(png.read_png(path)))
    rocks = tables.read_csv(tmp_path / "rocks.csv")
    assert rocks[["rock", "terrain", "terrain_rock"]].to_numpy().tolist() == [[1, 1, 1], [2, 1, 1]]
    assert {(tmp_path / meshes).resolve() for meshes in rocks["meshes"]} == {(folders / "meshes").resolve()}
    (sidecar,) = (tmp_path / "sidecars").iterdir()
    terrains = json.loads(sidecar.read_text())["terrains"]
    assert [part["offset_m"] for part in terrains] == [[0, 0, 0], [4, 0, 0]]


def test_auto_exposures_give_the_stated_brightness(tmp_path, views_of, tone):
    auto = {"percentile": 90, "grey": 2000}
    render_views(views_of(exposures_ms=["auto"], auto_exposure=auto), tmp_path, tone=tone)
    (path,) = (tmp_path / "images").iterdir()
    grey = png.read_png(path).astype(float) - BLACK_LEVEL
    lit = grey[grey > 0.25 * np.median(grey[grey > 0])]
    assert abs(np.percentile(lit, 90) + BLACK_LEVEL - 2000) < 10
    exposure = json.loads((tmp_path / f"sidecars/{path.stem}.json").read_text())["exposure_ms"]
    assert tables.read_csv(tmp_path / "index.csv")["exposure_ms"].tolist() == pytest.approx([exposure], rel=1e-5)


def test_an_image_without_light_has_the_longest_exposure():
    assert auto_exposure(np.zeros((4, 4), np.float32), 3.0, AutoExposure(longest_ms=500)) == 500
    assert auto_exposure(np.full((4, 4), 1e6, np.float32), 3.0, AutoExposure(shortest_ms=2)) == 2


def test_zip_takes_cameras_and_lights_in_turn(views_of):
    suns = {"kind": "sun", "azimuth_deg": [0, 120, 240], "elevation_deg": [10]}
    pairs = [(p.camera.name, p.light.name) for p in plan(views_of(cameras=[ORBIT], lights=[suns], combine="zip"))]
    assert pairs == [(f"orbit-{number:03d}", f"sun-{number:03d}") for number in range(3)]
    with pytest.raises(ConfigError):
        plan(views_of(cameras=[ORBIT], lights=[SUNS], combine="zip"))
    one = plan(views_of(lights=[suns], combine="zip", stereo=True))
    assert [(p.camera.name, p.light.name) for p in one][:2] == [("point-000L", "sun-000"), ("point-000R", "sun-000")]
    assert len(one) == 6


def test_close_exposures_have_different_names(views_of):
    assert [picture.name.split("_")[-1] for picture in plan(views_of(exposures_ms=[64, 64.00001]))][:2] == [
        "0064", "64.00001",
    ]  # fmt: skip


def test_many_lights_of_a_camera_are_rendered_in_units(views_of):
    suns = {"kind": "sun", "azimuth_deg": list(range(0, 300, 10)), "elevation_deg": [10]}
    pictures = plan(views_of(cameras=[ORBIT], lights=[suns], exposures_ms=[64, 128]))
    units = render_units(pictures, models=1)
    assert [len(unit) for unit in units.values()] == [48, 12] * 3
    assert [picture for unit in units.values() for picture in unit] == pictures
    for unit in units.values():
        assert len({picture.camera.name for picture in unit}) == 1


def test_stars_are_visible_only_in_the_sky_and_if_enabled(tmp_path, views_of, tone):
    camera = {"kind": "point", "position_m": [1.5, 1.2, 0.9], "look_at_m": [0, 0, 0.8]}
    for name, stars in (("black", None), ("real", {}), ("strong", {"intensity": 1e6})):
        render_views(views_of(cameras=[camera], stars=stars), tmp_path / name, tone=tone)
    black, real, strong = (png.read_png(next((tmp_path / n / "images").iterdir())) for n in ("black", "real", "strong"))
    sky = png.read_png(next((tmp_path / "black/instances").iterdir())) == 0
    assert (black[sky] == BLACK_LEVEL).all()
    assert real[sky].max() < BLACK_LEVEL + 10  # at a sunlit exposure
    assert (strong[sky] > BLACK_LEVEL + 20).sum() > 5
    np.testing.assert_array_equal(strong[~sky], black[~sky])
