import numpy as np
import pandas as pd
import pytest

from polarsim.formats import coco, png, tables, yolo
from polarsim.geometry.boxes import box_of_mask
from polarsim.geometry.camera import Camera
from polarsim.photo import PhotoKey
from polarsim.render.ground_truth import box_of_parts, boxes_of_ids
from polarsim.render.hits import cast_strip
from polarsim.render.lamps import Lamp
from polarsim.render.lighting import lighting
from polarsim.render.olat import NO_LAMP
from polarsim.render.options import RenderOptions
from polarsim.render.shadows import ground_shadows
from polarsim.render.surfaces import build_surfaces
from polarsim.run_files.instances import RELIEF_SHADOW, ROCK_IDS, SHADOW_IDS

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


def test_shadows_are_labelled_with_the_rock_that_casts_them(blocks, above, lens, plain, ids_of):
    surfaces = build_surfaces(blocks((4, 7), ((-0.7, 0.0), (0.6, 0.2))), plain)
    ids = ids_of(surfaces, above, lens, {"sun": SUN})["sun"]
    found = {(kind, rock): box for kind, rock, box in boxes_of_ids(ids, plain)}
    assert sorted(found) == [("rock", 4), ("rock", 7), ("shadow", 4), ("shadow", 7)]
    for rock in (4, 7):  # the lamp is at -Y, so shadows are directly above the rocks in the image
        assert found["shadow", rock][1] < found["rock", rock][1]
        assert found["shadow", rock][0] < found["rock", rock][2]
        assert found["shadow", rock][2] > found["rock", rock][0]


def test_ground_shaded_by_a_wall_has_no_rock_shadow(blocks, above, lens, plain, ids_of):
    lamp = Lamp(np.array([0.0, -3.0, 0.35]))
    for rim, expected in ((False, True), (True, False)):
        surfaces = build_surfaces(blocks(), RenderOptions(rim=rim, rim_half_width_m=1.0, rim_height_m=0.3))
        ids = ids_of(surfaces, above, lens, {"sun": lamp})["sun"]
        assert ("shadow" in [kind for kind, _, _ in boxes_of_ids(ids, plain)]) == expected
        assert (ids == RELIEF_SHADOW).any() == rim


def test_a_terrain_without_rocks_has_ground_and_no_boxes(blocks, above, lens, plain, ids_of):
    ids = ids_of(build_surfaces(blocks((), ()), plain), above, lens, {"sun": SUN}, threads=2)
    assert set(np.unique(ids["sun"])) == {1}
    assert boxes_of_ids(ids["sun"], plain) == []


def test_known_lit_pixels_give_the_same_shadow_ids(blocks, camera, lens, plain):
    surfaces = build_surfaces(blocks((4, 7), ((-0.7, 0.0), (0.6, 0.2))), plain)
    hits = cast_strip(surfaces, Camera(camera, lens), slice(0, lens.height))
    surface_ids = surfaces.id_of_face[hits.face]
    lit = lighting(surfaces, hits, SUN, falloff=True)[0]
    assert 0 < len(lit) < len(surface_ids)
    dark, unknown = np.ones((2, len(surface_ids)), bool)
    dark[lit] = False
    np.testing.assert_array_equal(
        *(ground_shadows(surfaces, hits, surface_ids, SUN, mask, samples=1) for mask in (dark, unknown))
    )


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
def labelled(folders, lens, monkeypatch):
    monkeypatch.setattr(yolo, "_SIZE", np.array([lens.width, lens.height], float))  # size of photos with the small lens
    for path in (folders / "meshes").iterdir():
        path.rename(path.with_name(path.name.replace("terrain01", "terrain03")))
    render_into(folders, {"lambert": folders / "twins"}, KEYS, RenderOptions(rim=False), labels=".", terrain=3)
    return folders


def test_every_key_has_a_file_equal_within_a_bracket(labelled):
    assert sorted(path.stem for path in (labelled / "boxes").iterdir()) == sorted(map(str, KEYS))
    for key in KEYS:
        first = labelled / "boxes" / f"{key.with_exposure(64)}.txt"
        assert (labelled / "boxes" / f"{key}.txt").read_text() == first.read_text()


def test_photos_without_lamp_have_no_labels(labelled):
    assert (labelled / "boxes" / "03_A_off_no_L_0256.txt").read_text() == ""
    ids = png.read_png(labelled / "instances" / "03_A_off_no_L.png")
    assert set(np.unique(ids)) == {0, 1, 1001}


def test_shadows_are_cast_by_the_sun_lamp_or_by_the_only_rover_light(labelled):
    texts = {key: (labelled / "boxes" / f"03_A_{key}_L_0256.txt").read_text() for key in ("off_30", "on_30", "on_no")}
    assert texts["off_30"] == texts["on_30"]
    assert texts["off_30"] != texts["on_no"]


def test_instances_table_and_boxes_agree(labelled, lens):
    rows = tables.read_parquet(labelled / "table.parquet", tables.LABEL_COLUMNS)
    assert set(rows.source) == {"rendered"}
    for key, group in rows.groupby("key"):
        classes, boxes = yolo.read_boxes(labelled / "boxes" / f"{key}.txt", size=(lens.width, lens.height))
        of_rows = group[["x0", "y0", "x1", "y1"]].to_numpy()
        np.testing.assert_allclose(np.sort(boxes, axis=0), np.sort(of_rows, axis=0), atol=1e-3)
        assert (classes == 0).sum() == (group.kind == "rock").sum()
        ids = png.read_png(labelled / "instances" / f"{key.rsplit('_', 1)[0]}.png")
        assert ids.dtype == np.uint16
        for row in group.itertuples():
            number = {"rock": 1000, "shadow": 2000}[row.kind] + row.rock
            window = ids[int(row.y0) : int(row.y1), int(row.x0) : int(row.x1)] == number
            assert window.any(axis=1).all()
            assert window.any(axis=0)[[0, -1]].all()
    assert isinstance(rows, pd.DataFrame)


def test_coco_has_the_boxes_and_masks_of_the_instances(labelled, lens):
    photos = coco.read_coco(labelled / "coco.json", (lens.width, lens.height))
    assert sorted(photos) == sorted(KEYS)
    rows = tables.read_parquet(labelled / "table.parquet", tables.LABEL_COLUMNS)
    assert sum(map(len, photos.values())) == len(rows)
    for key, annotations in photos.items():
        ids = png.read_png(labelled / "instances" / f"{str(key).rsplit('_', 1)[0]}.png")
        for annotation in annotations:
            number = {"rock": 1000, "shadow": 2000}[annotation.kind] + annotation.rock
            shown = annotation.mask.mask()
            assert (ids[shown] == number).all()
            assert shown.sum() >= 0.95 * (ids == number).sum()  # small components outside the box are excluded
            np.testing.assert_array_equal(box_of_mask(shown), annotation.box)
