import numpy as np
import pytest

from polarsim.formats import coco, png, tables, yolo
from polarsim.geometry.boxes import box_of_mask
from polarsim.photo import PhotoKey
from polarsim.render.ground_truth import box_of_parts, boxes_of_ids
from polarsim.render.lamps import Lamp
from polarsim.render.olat import NO_LAMP
from polarsim.render.options import RenderOptions
from polarsim.render.surfaces import build_surfaces
from polarsim.run_files.instances import ROCK_IDS, SHADOW_IDS

from .conftest import render_into

SIDE, HEIGHT = 0.4, 0.2  # metres, of the block

SUN = Lamp(np.array([0.0, -3.0, 1.2]))
KEYS = [PhotoKey.parse(f"03_A_{name}_{camera}_{ms:04d}") for name in ("off_30", "on_30", "on_no", "off_no")
        for camera in "LR" for ms in (64, 256)]  # fmt: skip


def corners(low, high):
    return np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])


def projected_box(points, pose, lens):
    pixels = lens.project(pose.inverse().apply(points))
    return np.concatenate([pixels.min(axis=0), pixels.max(axis=0)])


def test_the_box_of_a_block_is_the_box_around_its_projected_corners(surfaces, camera, lens, plain, ids_of):
    ids = ids_of(surfaces, camera, lens, {})[NO_LAMP]
    ((kind, rock, box),) = boxes_of_ids(ids, plain)
    expected = projected_box(corners([-SIDE / 2, -SIDE / 2, 0], [SIDE / 2, SIDE / 2, HEIGHT]), camera, lens)
    assert (kind, rock) == ("rock", 1)
    np.testing.assert_allclose(box, expected, atol=1.0)


def test_the_shadow_of_a_block_is_its_projection_from_the_lamp(surfaces, above, lens, plain, ids_of):
    ids = ids_of(surfaces, above, lens, {"sun": SUN})["sun"]
    tips = np.array([[x, SIDE / 2, HEIGHT] for x in (-SIDE / 2, SIDE / 2)])
    tips = SUN.position + (tips - SUN.position) * SUN.position[2] / (SUN.position[2] - HEIGHT)  # down to z = 0
    shadow = next(box for kind, rock, box in boxes_of_ids(ids, plain) if kind == "shadow")
    expected = projected_box(np.concatenate([tips, [[-SIDE / 2, SIDE / 2, 0], [SIDE / 2, SIDE / 2, 0]]]), above, lens)
    np.testing.assert_allclose(shadow[[0, 1, 2]], expected[[0, 1, 2]], atol=1.0)
    centre = ids[:, 100]  # through block and shadow, which are adjacent
    assert np.flatnonzero(centre == 2001)[-1] + 1 == np.flatnonzero(centre == 1001)[0]


def test_a_thin_line_of_dark_pixels_does_not_widen_a_shadows_box(plain):
    ids = np.zeros((60, 120), np.uint16)
    ids[20:40, 50:80] = SHADOW_IDS + 1
    ids[38:40, 10:50] = SHADOW_IDS + 1  # two pixels wide, along the base of the rock
    ids[5:7, 10:100] = ROCK_IDS + 1  # thin rocks are not excluded
    boxes = {kind: box.tolist() for kind, _, box in boxes_of_ids(ids, plain)}
    assert boxes["shadow"][2:] == [80, 40]
    assert boxes["shadow"][0] >= 50 - 3  # the start of the wide part
    assert boxes["rock"] == [10, 5, 100, 7]
    every = {
        kind: box.tolist() for kind, _, box in boxes_of_ids(ids, plain.model_copy(update={"min_shadow_width_px": 1}))
    }
    assert every["shadow"] == [10, 20, 80, 40]


def test_a_terrain_without_rocks_has_ground_and_no_boxes(blocks, above, lens, plain, ids_of):
    ids = ids_of(build_surfaces(blocks((), ()), plain), above, lens, {"sun": SUN}, threads=2)
    assert set(np.unique(ids["sun"])) == {1}
    assert boxes_of_ids(ids["sun"], plain) == []


def test_ids_do_not_depend_on_the_number_of_samples(surfaces, camera, lens, plain, ids_of):
    one, four = (
        ids_of(surfaces, camera, lens, {"sun": SUN}, options=plain.model_copy(update={"samples": samples}))
        for samples in (1, 4)
    )
    for name in ("sun", NO_LAMP):
        np.testing.assert_array_equal(one[name], four[name])


def test_small_components_are_excluded_from_a_box():
    mask = np.zeros((20, 30), bool)
    mask[5:9, 6:16] = True
    mask[15, 25] = True  # a small component
    np.testing.assert_array_equal(box_of_parts(mask, 30, 5), [6, 5, 16, 9])
    np.testing.assert_array_equal(box_of_parts(mask, 30, 1), [6, 5, 26, 16])
    assert box_of_parts(mask, 41, 5) is None
    assert box_of_parts(np.zeros((4, 4), bool), 1, 1) is None


@pytest.fixture
def labelled(folders):
    for path in (folders / "meshes").iterdir():
        path.rename(path.with_name(path.name.replace("terrain01", "terrain03")))
    render_into(folders, {"lambert": folders / "twins"}, KEYS, RenderOptions(walls=False), labels=".", terrain=3)
    return folders


def test_files_are_equal_within_a_bracket_and_shadows_are_cast_by_the_sun_or_the_only_rover_light(labelled):
    texts = {path.stem: path.read_text() for path in (labelled / "boxes").iterdir()}
    assert sorted(texts) == sorted(map(str, KEYS))
    for key in KEYS:
        assert texts[str(key)] == texts[str(key.with_exposure(64))]
    assert texts["03_A_off_30_L_0256"] == texts["03_A_on_30_L_0256"] != texts["03_A_on_no_L_0256"]
    assert texts["03_A_off_no_L_0256"] == ""
    assert set(np.unique(png.read_png(labelled / "instances" / "03_A_off_no_L.png"))) == {0, 1, 1001}


def test_table_and_boxes_agree(labelled, lens):
    rows = tables.read_parquet(labelled / "table.parquet", tables.LABEL_COLUMNS)
    assert set(rows.source) == {"rendered"}
    for key, group in rows.groupby("key"):
        classes, boxes = yolo.read_boxes(labelled / "boxes" / f"{key}.txt", size=(lens.width, lens.height))
        of_rows = group[["x0", "y0", "x1", "y1"]].to_numpy()
        np.testing.assert_allclose(np.sort(boxes, axis=0), np.sort(of_rows, axis=0), atol=1e-3)
        assert (classes == 0).sum() == (group.kind == "rock").sum()


def test_coco_has_the_boxes_and_masks_of_the_instances(labelled, lens):
    photos = coco.read_coco(labelled / "coco.json", (lens.width, lens.height), PhotoKey.parse)
    assert sorted(photos) == sorted(KEYS)
    rows = tables.read_parquet(labelled / "table.parquet", tables.LABEL_COLUMNS)
    assert sum(map(len, photos.values())) == len(rows)
    for key, annotations in photos.items():
        ids = png.read_png(labelled / "instances" / f"{str(key).rsplit('_', 1)[0]}.png")
        assert ids.dtype == np.uint16
        for annotation in annotations:
            number = {"rock": 1000, "shadow": 2000}[annotation.kind] + annotation.rock
            shown = annotation.mask.mask()
            assert (ids[shown] == number).all()
            assert shown.sum() >= 0.95 * (ids == number).sum()  # small components outside the box are excluded
            np.testing.assert_array_equal(box_of_mask(shown), annotation.box)
