"""Folder of labelled images."""

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
from polarsim.render.views.folder import divided
from polarsim.render.views.options import AutoExposure
from polarsim.render.views.plan import plan
from polarsim.render.views.run import auto_exposure, render_units, render_views

ORBIT = {"kind": "orbit", "radius_m": 1.6, "height_m": 0.9, "number": 3}
SUNS = {"kind": "sun", "azimuth_deg": [0, 140], "elevation_deg": [20]}
SIZE = (96, 64)


@pytest.fixture
def grid(views_of):
    """12 pictures: 3 cameras, 2 lights, 2 models."""
    render = {"models": ["lambert", "hapke"], "walls": False, "noise": True}
    return views_of(cameras=[ORBIT], lights=[SUNS], render=render)


@pytest.fixture
def out(tmp_path):
    return tmp_path / "out"


def files(folder):
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_every_image_has_labels_and_a_row_in_the_listings(out, grid, tone):
    assert render_views(grid, out, tone=tone) == 12
    index = tables.read_csv(out / "index.csv")
    coco = json.loads((out / "annotations.json").read_text())
    count = Counter(row["image_id"] for row in coco["annotations"])
    assert len(index) == len(coco["images"]) == 12
    for image, (_, row) in zip(coco["images"], index.iterrows(), strict=True):
        assert image["file_name"] == f"images/{row['name']}.png"
        assert png.read_photo(out / image["file_name"], SIZE).max() > BLACK_LEVEL + 50
        classes, boxes = yolo.read_boxes(out / f"labels/{row['name']}.txt", SIZE)
        ids = png.read_png(out / "instances" / row["instances"])
        found = boxes_of_ids(ids, grid.render)
        assert [BOX_CLASSES[number] for number in classes] == [kind for kind, _, _ in found]
        np.testing.assert_allclose(boxes, [box for _, _, box in found], atol=1e-3)
        assert count[image["id"]] == len(found) == row["rocks"] + row["shadows"]
    assert index["rocks"].min() == 1
    assert index["shadows"].max() == 1
    assert not [path for path in out.rglob(".*") if path.is_file()]
    assert (out / "contact.jpg").stat().st_size > 1000


def test_training_and_validation_share_no_camera_after_a_move(out, folders, views_of, tone):
    orbit = ORBIT | {"number": 7}
    views = views_of(cameras=[orbit], lights=[SUNS], render={"models": ["lambert"], "walls": False}, stereo=True)
    render_views(views, out / "made", tone=tone, scale=0.25)
    moved = out / "elsewhere"
    shutil.unpack_archive(shutil.make_archive(str(out / "set"), "zip", out / "made"), moved)
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


@pytest.mark.parametrize(
    "faults", [{}, {"blur_px": 1.0, "bloom": 0.05, "veiling_glare": 0.01, "lens_flare": 0.01, "vignetting": True}]
)
def test_images_equal_those_of_a_scene(out, folders, views_of, tone, faults):
    views = views_of()
    views = views.model_copy(update={"render": views.render.model_copy(update=faults)})
    render_views(views, out, tone=tone)
    (picture,) = plan(views)
    one = Scene(folders / "meshes", 1, views.render).picture(picture.shot(64.0))
    np.testing.assert_array_equal(png.read_png(out / f"images/{picture.name}.png"), one)


def test_bytes_do_not_depend_on_threads(out, grid, tone):
    for threads in (1, 3):
        render_views(grid, out / str(threads), tone=tone, threads=threads)
    assert files(out / "1") == files(out / "3")


def test_limit_renders_the_first_images_to_a_new_folder(out, grid, tone):
    assert render_views(grid, out / "few", tone=tone, limit=5) == 5
    names = [picture.name for picture in plan(grid)]
    assert sorted(path.stem for path in (out / "few/images").iterdir()) == sorted(names[:5])
    rocks = tables.read_csv(out / "few/rocks.csv")
    assert rocks[["rock", "terrain", "terrain_rock"]].to_numpy().tolist() == [[1, 1, 1]]
    assert {(out / "few" / meshes).resolve() for meshes in rocks["meshes"]} == {grid.scenes[0].meshes.resolve()}
    with pytest.raises(ConfigError):
        render_views(grid, out / "few", tone=tone)


def test_previews_have_eight_bits(out, views_of, tone):
    render_views(views_of(), out, tone=tone, preview=True)
    (path,) = (out / "images").iterdir()
    pixels = png.read_png(path)
    assert (pixels.dtype, pixels.ndim) == (np.uint8, 2)
    assert json.loads((out / f"sidecars/{path.stem}.json").read_text())["bits"] == 8


def test_auto_exposures_give_the_stated_brightness(out, views_of, tone):
    auto = {"percentile": 90, "grey": 2000}
    render_views(views_of(exposures_ms=["auto"], auto_exposure=auto), out, tone=tone)
    (path,) = (out / "images").iterdir()
    grey = png.read_png(path).astype(float) - BLACK_LEVEL
    lit = grey[grey > 0.25 * np.median(grey[grey > 0])]
    assert abs(np.percentile(lit, 90) + BLACK_LEVEL - 2000) < 10
    exposure = json.loads((out / f"sidecars/{path.stem}.json").read_text())["exposure_ms"]
    assert tables.read_csv(out / "index.csv")["exposure_ms"].tolist() == pytest.approx([exposure], rel=1e-5)


def test_an_image_without_light_has_the_longest_exposure():
    assert auto_exposure(np.zeros((4, 4), np.float32), 3.0, AutoExposure()) == 8192
    assert auto_exposure(np.full((4, 4), 1e6, np.float32), 3.0, AutoExposure()) == 1


def test_close_exposures_have_different_names(views_of):
    assert [picture.name.split("_")[-1] for picture in plan(views_of(exposures_ms=[64, 64.00001]))][:2] == [
        "0064", "64.00001",
    ]  # fmt: skip


def test_many_lights_of_a_camera_are_rendered_in_units(views_of):
    suns = {"kind": "sun", "azimuth_deg": list(range(0, 300, 10)), "elevation_deg": [10]}
    pictures = plan(views_of(cameras=[ORBIT], lights=[suns], exposures_ms=[64, 128]))
    units = render_units(pictures, models=1)
    assert [len(unit) for unit in units] == [48, 12] * 3
    assert [picture for unit in units for picture in unit] == pictures
    for unit in units:
        assert len({picture.camera.name for picture in unit}) == 1


def test_stars_are_visible_only_in_the_sky_and_if_enabled(out, views_of, tone):
    camera = {"kind": "point", "position_m": [1.5, 1.2, 0.9], "look_at_m": [0, 0, 0.8]}
    for name, stars in (("black", None), ("real", {}), ("strong", {"intensity": 1e6})):
        render_views(views_of(cameras=[camera], stars=stars), out / name, tone=tone)
    black, real, strong = (png.read_png(next((out / n / "images").iterdir())) for n in ("black", "real", "strong"))
    sky = png.read_png(next((out / "black/instances").iterdir())) == 0
    assert (black[sky] == BLACK_LEVEL).all()
    assert real[sky].max() < BLACK_LEVEL + 10  # at a sunlit exposure
    assert (strong[sky] > BLACK_LEVEL + 20).sum() > 5
    np.testing.assert_array_equal(strong[~sky], black[~sky])
