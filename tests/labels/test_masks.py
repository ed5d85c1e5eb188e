import json

import numpy as np
import pandas as pd
import pytest
from scipy.spatial import ConvexHull
from shapely import Polygon

from polarsim.formats import png, tables, yolo
from polarsim.formats.coco import read_coco
from polarsim.formats.tables import PHOTO_COLUMNS, key_columns, write_parquet
from polarsim.geometry.polygons import paint, rasterised, signed_area
from polarsim.labels.masks import BOX_COLUMNS, draw_masks
from polarsim.photo import BOX_CLASSES, COLOURS, GREY_VALUES, SHADOW, PhotoKey
from polarsim.run_files import lamps
from polarsim.site import polar
from tests.support.polar_photos import SIZE

from .conftest import BLOCKS, TERRAIN, block, localised
from .test_propagate import propagate

KEYS = [
    key
    for key in polar().photos_of(TERRAIN)
    if key.position == "A" and key.camera == "L" and key.exposure_ms in (64, 128, 2048) and key.azimuth in ("no", "30")
]


def draw(scene, out, keys=KEYS):
    propagate(scene, out, keys)
    return draw_table(scene, out, keys)


def photo_table(out, keys):
    """Write a photo table of a source; the last photo is missing."""
    rows = [key_columns(key) | {"path": str(out / f"photos/Sun_{key.azimuth}/Cam_{key}.png")} for key in keys[:-1]]
    write_parquet(out / "photos.parquet", pd.DataFrame(rows, columns=list(PHOTO_COLUMNS)))
    return out / "photos.parquet"


def test_coco_contains_paths_relative_to_its_folder(annotated):
    images = {image["key"]: image["file_name"] for image in json.loads((annotated / "coco.json").read_text())["images"]}
    *there, missing = KEYS
    assert all(images[str(key)] == f"photos/Sun_{key.azimuth}/Cam_{key}.png" for key in there)
    assert images[str(missing)] == f"{missing}.png"
    assert set(read_coco(annotated / "coco.json", polar().images.size, PhotoKey.parse)) == set(KEYS)


def draw_table(scene, out, keys):
    draw_masks(
        site=polar(),
        terrain=TERRAIN,
        keys=keys,
        photos=photo_table(out, keys),
        table=out / "labels.parquet",
        cameras=scene.cameras,
        meshes=scene.meshes,
        polygons=out / "polygons",
        masks=out / "masks",
        preview=out / "preview.png",
        annotations=out / "coco.json",
    )
    return out


@pytest.fixture(scope="module")
def annotated(untouched_scene, tmp_path_factory):
    return draw(untouched_scene, tmp_path_factory.mktemp("annotated"))


def grey(annotated, name):
    return png.read_png(annotated / "masks" / f"{name}.png")


def test_the_preview_shows_rocks_and_shadows_in_colour(annotated):
    pixels = png.read_png(annotated / "preview.png")[40:]  # without the legend
    assert all((pixels == colour).all(axis=-1).sum() > 20 for colour in COLOURS.values())


def test_grey_maps_are_the_painted_polygons_and_show_the_scene(untouched_scene, annotated):
    for folder in ("polygons", "masks"):
        assert {path.stem for path in (annotated / folder).iterdir()} == {str(key) for key in KEYS}
    polygons = yolo.read_polygons(annotated / "polygons" / "03_A_off_30_L_0128.txt", size=SIZE)
    picture = grey(annotated, "03_A_off_30_L_0128")
    assert (picture != paint(polygons, (1216, 1936))).mean() < 1e-5  # the file's six decimals may move a pixel
    assert set(np.unique(picture)) == set(GREY_VALUES.values())
    assert picture[600, 900] == GREY_VALUES["ground"]
    assert picture[5, 900] == GREY_VALUES["background"]  # above the wall
    for rock in BLOCKS:
        x0, y0, x1, y1 = untouched_scene.expected_box("A", "L", rock).round().astype(int)
        share = (picture[y0:y1, x0:x1] == GREY_VALUES["rock"]).mean()
        assert 0.6 < share < 0.98  # a block seen from above one of its corners fills most of its box
        assert (picture[y0 - 20 : y0 - 3, x0:x1] != GREY_VALUES["rock"]).all()


def test_polygons_are_valid_and_inside_the_photo(annotated):
    for number, ring in yolo.read_polygons(annotated / "polygons" / "03_A_off_30_L_0128.txt", size=SIZE):
        assert number in range(4)
        assert Polygon(ring).is_valid
        assert signed_area(ring) > 0
        assert ring.min() >= 0
        assert (ring <= [1936, 1216]).all()


def test_all_exposures_and_lights_share_polygons(annotated):
    whole = grey(annotated, "03_A_off_30_L_0128")
    for name in ("03_A_off_30_L_0064", "03_A_on_30_L_2048"):
        np.testing.assert_array_equal(grey(annotated, name), whole)


def test_a_photo_without_visible_objects_is_background(untouched_scene, tmp_path):
    name = "03_A_off_no_L_0064"  # no lamp, short exposure
    dark = draw(untouched_scene, tmp_path, [PhotoKey.parse(name)])
    assert not grey(dark, name).any()
    ((number, ring),) = yolo.read_polygons(dark / "polygons" / f"{name}.txt", size=SIZE)
    assert number == 0
    assert signed_area(ring) == pytest.approx(1936 * 1216)


def test_labels_of_a_rock_without_mesh_still_get_outlines(scene, tmp_path):
    (scene.meshes / "terrain03_rock7.obj").unlink()
    keys = [key for key in KEYS if key.azimuth == "30"][:2]
    draw(scene, tmp_path, keys)
    x0, y0, x1, y1 = scene.expected_box("A", "L", 7).round().astype(int)
    for key in keys:
        assert (grey(tmp_path, key)[y0:y1, x0:x1] == GREY_VALUES["rock"]).mean() > 0.5


@pytest.fixture(scope="module")
def coco_file(annotated):
    return read_coco(annotated / "coco.json", polar().images.size, PhotoKey.parse)


def key_of(name: str) -> PhotoKey:
    return PhotoKey.parse(name)


def test_coco_lists_every_photo_with_its_own_labels(annotated, coco_file):
    assert set(coco_file) == set(KEYS)
    for key in KEYS:
        classes, boxes = yolo.read_boxes(annotated / "boxes" / f"{key}.txt", size=SIZE)
        kinds = [BOX_CLASSES[number] for number in classes]
        expected = sorted(zip(kinds, boxes.round(2).tolist(), strict=True))
        found = sorted((own.kind, own.box.round(2).tolist()) for own in coco_file[key])
        assert [kind for kind, _ in found] == [kind for kind, _ in expected]
        np.testing.assert_allclose([box for _, box in found], [box for _, box in expected], atol=0.02)


def test_photos_too_dark_for_shadows_have_no_shadows_in_coco_only(annotated, coco_file):
    dark, bright = key_of("03_A_off_30_L_0064"), key_of("03_A_off_30_L_0128")
    assert {own.kind for own in coco_file[dark]} == {"rock"}
    assert {own.kind for own in coco_file[bright]} == {"rock", "shadow"}
    assert (grey(annotated, dark) == GREY_VALUES["shadow"]).any()


def test_coco_masks_are_the_regions_of_the_grey_map(annotated, coco_file):
    picture = grey(annotated, "03_A_off_30_L_0128")
    for kind in BOX_CLASSES:
        masks = [own.mask.mask() for own in coco_file[key_of("03_A_off_30_L_0128")] if own.kind == kind]
        assert np.sum(masks, axis=0).max() == 1  # no pixel is listed twice
        together, painted = np.any(masks, axis=0), picture == GREY_VALUES[kind]
        assert (together & painted).sum() / (together | painted).sum() >= 0.98


def relabelled(untouched_scene, out, labels, keys):
    """Draw masks from a label table with rows of key, kind, rock and box."""
    named = {"source": "seed", "confidence": 1.0}
    rows = [
        {**tables.key_columns(key), "kind": kind, "rock": rock, **named, **dict(zip(BOX_COLUMNS, box, strict=True))}
        for key, kind, rock, box in labels
    ]
    tables.write_parquet(out / "labels.parquet", tables.label_table(rows))
    draw_table(untouched_scene, out, keys)
    return read_coco(out / "coco.json", polar().images.size, PhotoKey.parse)


DIM, LIT = key_of("03_A_off_30_L_0064"), key_of("03_A_off_30_L_0128")
FAR_BOX, NEAR_BOX = [600.0, 500, 700, 580], [640.0, 540, 760, 640]


def test_rocks_occlude_objects_and_fully_hidden_objects_are_dropped(untouched_scene, tmp_path):
    wide, narrow = [560.0, 560, 720, 700], [670.0, 560, 720, 600]
    labels = [(LIT, "rock", -1, NEAR_BOX), (LIT, "rock", -1, FAR_BOX), (LIT, "shadow", -1, wide)]
    found = relabelled(untouched_scene, tmp_path, [*labels, (LIT, "shadow", -1, narrow)], [LIT])[LIT]
    assert len(found) == len(labels)
    near, far, shadow = (next(own.mask.mask() for own in found if own.box[0] == x) for x in (640, 600, 560))
    np.testing.assert_array_equal(near, whole(NEAR_BOX))
    np.testing.assert_array_equal(far, whole(FAR_BOX) & ~near)
    np.testing.assert_array_equal(shadow, whole(wide) & ~near & ~far)


def test_rocks_invisible_in_a_dark_photo_still_occlude(untouched_scene, tmp_path):
    labels = [(LIT, "rock", 21, NEAR_BOX), (LIT, "rock", 22, FAR_BOX), (DIM, "rock", 22, [601.0, 500, 700, 580])]
    found = relabelled(untouched_scene, tmp_path, labels, [DIM, LIT])
    near, (far,) = next(own for own in found[LIT] if own.rock == 21), found[DIM]
    np.testing.assert_allclose(far.box, [601, 500, 700, 580])
    assert (near.mask.mask() & whole(FAR_BOX)).any()
    assert not (near.mask.mask() & far.mask.mask()).any()


@pytest.mark.parametrize("kind", BOX_CLASSES)
def test_an_outline_with_an_inaccurate_box_is_close_to_the_mesh(untouched_scene, tmp_path, kind):
    pen = {rock: np.array(off) for rock, off in zip(BLOCKS, ([7.0, -5, -6, 4], [-6.0, 5, 7, 6]), strict=True)}
    rings = {rock: true_outline(kind, rock) for rock in BLOCKS}
    boxes = {rock: np.concatenate([ring.min(axis=0), ring.max(axis=0)]) + pen[rock] for rock, ring in rings.items()}
    labels = [(LIT, kind, rock, box) for rock, box in boxes.items()]
    for own in relabelled(untouched_scene, tmp_path, labels, [LIT])[LIT]:
        true, box = rings[own.rock], boxes[own.rock]
        low, extent = true.min(axis=0), np.ptp(true, axis=0)
        full = rasterised(box[:2] + (true - low) / extent * (box[2:] - box[:2]), (1216, 1936))
        true = rasterised(true, (1216, 1936))
        assert 1 - mask_iou(own.mask.mask(), true) < 0.8 * (1 - mask_iou(full, true))
        np.testing.assert_allclose(own.box, box, atol=0.01)  # the box of the label is unchanged


def true_outline(kind: str, rock: int) -> np.ndarray:
    """Return the outline (n, 2) of a block or of its shadow on flat sand, px; both are convex."""
    corners = block(*BLOCKS[rock]).vertices
    if kind == SHADOW:
        corners = on_the_sand(corners)
    pixels = localised("A").project("L", corners)
    return pixels[ConvexHull(pixels).vertices]


def on_the_sand(points: np.ndarray) -> np.ndarray:
    """Project points (n, 3) from a lamp onto the ground."""
    lamp = lamps.surveyed_suns({position: localised(position) for position in "AC"}, polar(), 1)[LIT.azimuth]
    return points + points[:, 2:] / (lamp[2] - points[:, 2:]) * (points - lamp)


def mask_iou(first: np.ndarray, second: np.ndarray) -> float:
    return (first & second).sum() / (first | second).sum()


def whole(box: list[float]) -> np.ndarray:
    """Return the pixels of a visible label without a mesh: a superellipse of power 2.5 in the box."""
    y, x = np.mgrid[:1216, :1936] + 0.5
    across, down = (2 * x - box[0] - box[2]) / (box[2] - box[0]), (2 * y - box[1] - box[3]) / (box[3] - box[1])
    return np.abs(across) ** 2.5 + np.abs(down) ** 2.5 <= 1
