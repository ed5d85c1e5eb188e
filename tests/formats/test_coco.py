import contextlib
import io
import json
from functools import partial

import cv2
import hypothesis.extra.numpy as arrays
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pycocotools.coco import COCO
from pydantic import ValidationError

from polarsim.errors import FormatError
from polarsim.formats import coco, rle
from polarsim.formats.coco_annotations import Amodal, Annotation
from polarsim.photo import NO_ROCK, ROCK, SHADOW, PhotoKey
from polarsim.site import polar
from tests.support.other_site import CONTENT, one_camera, other_site

POLAR = polar()
SIZE = POLAR.images.size
GRID = [key for terrain in POLAR.terrains for key in POLAR.photos_of(terrain)]
read_coco = partial(coco.read_coco, size=SIZE, key_of=POLAR.key_of_picture)
write_coco = partial(coco.write_coco, site=POLAR, size=SIZE)
KEY, OTHER = PhotoKey.parse("01_A_off_30_L_0256"), PhotoKey.parse("01_A_off_30_R_0256")


def block(left: int, top: int, width: int, height: int) -> tuple[np.ndarray, rle.Rle]:
    return np.array([left, top, left + width, top + height], float), rle.encode_rle(
        np.ones((height, width)), SIZE, left, top
    )


PHOTOS = {
    OTHER: [],
    KEY: [
        Annotation(ROCK, 7, *block(100, 200, 30, 20), "seed", 1.0),
        Annotation(ROCK, NO_ROCK, *block(300, 200, 30, 20), "fused", 0.9),
        Annotation(ROCK, 12, *block(500, 200, 40, 20), "fused", 0.6),
        Annotation(SHADOW, 12, *block(540, 210, 50, 10), "cast", 0.5),
        Annotation(SHADOW, 99, *block(700, 210, 50, 10), "cast", 0.5),
        Annotation(SHADOW, NO_ROCK, *block(900, 210, 50, 10), "seed", 1.0),
    ],
}


def all_photos(site):
    return [key for terrain in site.terrains for key in site.photos_of(terrain)]


def test_images_of_a_site_keep_their_ids_when_the_site_grows():
    site = other_site()
    ids = {key: site.image_id(key) for key in all_photos(site)}
    assert len(set(ids.values())) == len(ids) == 2 * 2 * 2 * 2 * (2 * 3 + 1)
    assert list(ids.values()) == sorted(ids.values())  # in the order of the site
    assert min(ids.values()) > 0
    assert max(ids.values()) * coco.PER_PHOTO < 2**53  # annotation ids are exact in JavaScript, too
    grown = other_site(
        terrains=[*CONTENT["terrains"], "yard-c"],
        positions=[*CONTENT["positions"], "roof"],
        lamps={**CONTENT["lamps"], "7": {"position_m": [3, 0, 1]}},
        exposures_ms=[5, 10, 20, 40, 160],
    )
    assert {key: grown.image_id(key) for key in ids} == ids
    assert len({grown.image_id(key) for key in all_photos(grown)}) == len(all_photos(grown)) > len(ids)
    assert {key: one_camera().image_id(key) for key in all_photos(one_camera())}.items() <= ids.items()


@pytest.mark.parametrize("field", ["positions", "lamps", "exposures_ms"])
def test_a_site_with_too_little_room_for_ids_is_refused(field):
    room = {"positions": 1, "lamps": 2, "exposures_ms": [10, 40, 160]}
    with pytest.raises(ValidationError, match=rf"image_ids\.{field}"):
        other_site(image_ids={field: room[field]})


def test_files_of_another_site_have_its_keys_and_size(tmp_path):
    site = other_site()
    key = site.key("yard-a_gate_off_45_L_0040")
    label = Annotation(ROCK, 3, np.array([600.0, 10, 630, 40]))
    coco.write_coco(tmp_path / "a.json", {key: [label]}, site, site.images.size)
    content = json.loads((tmp_path / "a.json").read_text())
    assert content["images"][0] | {"id": 0} == {
        "id": 0, "file_name": f"{key}.png", "width": 640, "height": 480, "key": str(key), "terrain": "yard-a",
        "position": "gate", "light": "off", "azimuth": "45", "camera": "L", "exposure_ms": 40,
    }  # fmt: skip
    assert "yard" in content["info"]["description"]
    for key_of in (PhotoKey.parse, site.key_of_picture):
        ((found,),) = coco.read_coco(tmp_path / "a.json", site.images.size, key_of).values()
        assert same(found, label)
    with pytest.raises(FormatError, match="site polar"):
        read_coco(tmp_path / "a.json", size=site.images.size)


@pytest.fixture
def written(tmp_path):
    write_coco(tmp_path / "labels.json", PHOTOS)
    return tmp_path / "labels.json"


def opened(path) -> COCO:
    with contextlib.redirect_stdout(io.StringIO()):
        return COCO(path)


def same(first: Annotation, second: Annotation) -> bool:
    same_values = [getattr(first, n) == getattr(second, n) for n in ("kind", "rock", "mask", "source", "confidence")]
    boxes = [(first.box, second.box)]
    if first.amodal and second.amodal:
        boxes.append((first.amodal.box, second.amodal.box))
        same_values.append(first.amodal.mask == second.amodal.mask)
    same_values.append((first.amodal is None) == (second.amodal is None))
    return all(same_values) and all(np.allclose(*pair, atol=2e-3) for pair in boxes)  # three decimals


def test_pycocotools_reads_the_same_masks_areas_and_boxes(written):
    coco = opened(written)
    (photo,) = [image for image in coco.dataset["images"] if image["file_name"] == "01_A_off_30_L_0256.png"]
    rows = coco.loadAnns(coco.getAnnIds(imgIds=[photo["id"]]))
    names = {row["id"]: row["name"] for row in coco.loadCats(coco.getCatIds())}
    assert [(names[row["category_id"]], row["rock"]) for row in rows] == [(own.kind, own.rock) for own in PHOTOS[KEY]]
    for row, own in zip(rows, PHOTOS[KEY], strict=True):
        x0, y0, x1, y1 = own.box.astype(int)
        expected = np.zeros((1216, 1936), bool)
        expected[y0:y1, x0:x1] = True
        np.testing.assert_array_equal(coco.annToMask(row), expected)
        assert row["area"] == expected.sum()
        assert row["bbox"] == [x0, y0, x1 - x0, y1 - y0]


def test_a_shadow_refers_to_the_rock_in_the_same_photo(written):
    rows = json.loads(written.read_text())["annotations"]
    rock = next(row for row in rows if row["rock"] == 12 and row["category_id"] == 1)
    shadows = {row["rock"]: row["shadow_of"] for row in rows if row["category_id"] == 2}
    assert shadows == {12: rock["id"], 99: None, NO_ROCK: None}
    assert all("shadow_of" not in row for row in rows if row["category_id"] == 1)


def test_every_photo_has_a_unique_id():
    ids = [POLAR.image_id(key) for key in GRID]
    assert len(set(ids)) == len(GRID)
    assert min(ids) > 0
    assert max(ids) * 10_000 < 2**31  # ids of annotations fit in 32 bits


@st.composite
def annotations(draw):
    mask = draw(arrays.arrays(bool, st.tuples(st.integers(1, 6), st.integers(1, 6))))
    left, top = draw(st.integers(0, 1929)), draw(st.integers(0, 1210))
    box = np.array([left, top, left + draw(st.floats(2, 6)), top + draw(st.floats(2, 6))])
    known = draw(st.booleans())
    whole = np.pad(mask, ((0, 0), (0, 1)), constant_values=True)  # a column more is hidden
    amodal = Amodal(rle.encode_rle(whole, SIZE, left, top), box + np.eye(4)[2]) if draw(st.booleans()) else None
    return Annotation(
        draw(st.sampled_from([ROCK, SHADOW])),
        draw(st.integers(-1, 2000)),
        box,
        rle.encode_rle(mask, SIZE, left, top) if known else None,
        draw(st.sampled_from(["seed", "fused", "projected", "cast", ""])),
        draw(st.floats(0, 1)),
        amodal,
    )


any_photos = st.dictionaries(st.sampled_from(GRID), st.lists(annotations(), max_size=4), max_size=3)


@settings(deadline=None, max_examples=20)
@given(photos=any_photos)
def test_annotations_read_back(tmp_path_factory, photos):
    path = tmp_path_factory.mktemp("coco") / "a.json"
    write_coco(path, photos)
    found = read_coco(path)
    assert found.keys() == photos.keys()
    for key, rows in photos.items():
        assert len(found[key]) == len(rows)
        assert all(same(a, b) for a, b in zip(found[key], rows, strict=True))


def test_amodal_fields_are_written_only_if_known(tmp_path):
    seen, whole = rle.encode_rle(np.ones((20, 30)), SIZE, 100, 200), rle.encode_rle(np.ones((20, 40)), SIZE, 100, 200)
    box, whole_box = np.array([100.0, 200, 130, 220]), np.array([100.0, 200, 140, 220])
    labels = [Annotation(ROCK, 7, box, seen, amodal=Amodal(whole, whole_box)), Annotation(ROCK, 8, box, seen)]
    write_coco(tmp_path / "a.json", {KEY: labels})
    first, second = json.loads((tmp_path / "a.json").read_text())["annotations"]
    assert first["visible_share"] == 0.75
    assert first["amodal_bbox"] == [100, 200, 40, 20]
    assert first["amodal_segmentation"] == {"size": [1216, 1936], "counts": whole.counts}
    assert set(first) - set(second) == {"visible_share", "amodal_bbox", "amodal_segmentation"}
    write_coco(tmp_path / "b.json", {KEY: labels}, simplify_px=0.6)
    assert np.array(json.loads((tmp_path / "b.json").read_text())["annotations"][0]["amodal_segmentation"]).shape == (
        1,
        8,
    )


def test_masks_may_be_written_as_polygons(tmp_path):
    y, x = np.mgrid[:60, :80] + 0.5
    ring = ((x - 40) / 38) ** 2 + ((y - 30) / 28) ** 2 < 1  # with a hole, less a corner
    ring &= ~((np.abs(x - 40) < 9) & (np.abs(y - 30) < 7)) & (x + y > 40)
    write_coco(
        tmp_path / "a.json",
        {KEY: [Annotation(ROCK, 3, np.array([0.0, 0, 80, 60]), rle.encode_rle(ring, SIZE))]},
        simplify_px=0.6,
    )
    (row,) = opened(tmp_path / "a.json").dataset["annotations"]
    areas = [cv2.contourArea(np.array(points, np.float32).reshape(-1, 2)) for points in row["segmentation"]]
    assert areas == sorted(areas, reverse=True)
    assert sum(areas) == pytest.approx(ring.sum(), rel=0.02)
    ((found,),) = read_coco(tmp_path / "a.json").values()
    back = found.mask.mask()[:60, :80]
    assert (back & ring).sum() >= 0.98 * (back | ring).sum()


def foreign(tmp_path, **changes):
    """A file of an annotation tool with a square rock in a photo."""
    annotation = {"id": 1, "image_id": 5, "category_id": 0, "bbox": [10, 20, 4, 4], "segmentation": [], "iscrowd": 0}
    content = {
        "images": [{"id": 5, "file_name": "01_A_off_30_L_0256.png", "width": 1936, "height": 1216}],
        "categories": [{"id": 1, "name": "Shadow"}, {"id": 0, "name": "rock"}],
        "annotations": [annotation],
    }
    annotation |= changes.pop("annotation", {})
    content["images"][0] |= changes.pop("image", {})
    path = tmp_path / "foreign.json"
    path.write_text(json.dumps(content | changes))
    return path


SQUARE = np.zeros((1216, 1936), bool)
SQUARE[20:24, 10:14] = True


@pytest.mark.parametrize(
    "name",
    ["01_A_off_30_L_0256.jpg", "data/01_A_off_30_L_0256.png", r"..\..\upload\4\cb0618f6-01_A_off_30_L_0256.png"],
)
def test_photo_keys_are_found_in_folders_after_prefixes_and_with_other_suffixes(tmp_path, name):
    assert list(read_coco(foreign(tmp_path, image={"file_name": name}))) == [KEY]


@pytest.mark.parametrize(
    "segmentation",
    [
        [[10, 20, 14, 20, 14, 24, 10, 24]],
        [[10, 20, 12, 20, 12, 24, 10, 24], [12, 20, 14, 20, 14, 24, 12, 24]],
        {"size": [1216, 1936], "counts": [12180, 4, 1212, 4, 1212, 4, 1212, 4, 2338344]},  # 10 * 1216 + 20 before it
    ],
)
def test_masks_are_read_from_polygons_and_from_plain_runs(tmp_path, segmentation):
    ((found,),) = read_coco(foreign(tmp_path, annotation={"segmentation": segmentation})).values()
    np.testing.assert_array_equal(found.mask.mask(), SQUARE)


def test_a_missing_box_is_computed_from_the_mask(tmp_path):
    own = {"bbox": [], "segmentation": [[10, 20, 14, 20, 14, 24, 10, 24]]}
    ((found,),) = read_coco(foreign(tmp_path, annotation=own)).values()
    np.testing.assert_allclose(found.box, [10, 20, 14, 24])


@pytest.mark.parametrize(
    ("own", "rock"),
    [({}, NO_ROCK), ({"rock": 4}, 4), ({"attributes": {"rock": "4", "occluded": False}}, 4),
     ({"attributes": {"rock": ""}}, NO_ROCK), ({"attributes": None, "rock": None}, NO_ROCK)],
)  # fmt: skip
def test_rock_ids_may_be_attributes_or_missing(tmp_path, own, rock):
    ((found,),) = read_coco(foreign(tmp_path, annotation=own)).values()
    assert (found.rock, found.source, found.confidence) == (rock, "", 1.0)


@pytest.mark.parametrize(
    "changes",
    [
        {"annotations": None},
        {"categories": [{"id": 0, "name": "ground"}]},
        {"annotation": {"category_id": 9}},
        {"annotation": {"image_id": 6}},
        {"annotation": {"bbox": [10, 20, 4]}},
        {"annotation": {"bbox": [10, 20, 0, 4]}},
        {"annotation": {"bbox": [2000, 20, 4, 4]}},
        {"annotation": {"bbox": [10, 20, float("nan"), 4]}},
        {"annotation": {"bbox": []}},
        {"annotation": {"segmentation": [[1, 2, 3, 4]]}},
        {"annotation": {"segmentation": [[1, 2, 3, 4, 1e300, 5]]}},
        {"annotation": {"segmentation": {"size": [1216, 1936], "counts": "04"}}},
        {"annotation": {"segmentation": {"size": [12, 19], "counts": [228]}}},
        {"annotation": {"rock": "pebble"}},
        {"image": {"width": 968}},
        {"image": {"file_name": "holiday.png"}},
        {"images": [{"id": 5, "file_name": f"{key}.png"} for key in (KEY, OTHER)]},
    ],
)
def test_an_invalid_file_is_a_one_line_error(tmp_path, changes):
    path = foreign(tmp_path, **changes)
    with pytest.raises(FormatError) as caught:
        read_coco(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("folders", [("", ""), ("a/", "b/")])
def test_a_photo_that_is_listed_twice_is_an_error(tmp_path, folders):
    images = [{"id": n, "file_name": f"{folder}{KEY}.png"} for n, folder in enumerate(folders)]
    with pytest.raises(FormatError, match=str(KEY)):
        read_coco(foreign(tmp_path, images=images, annotations=[]))


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"\xff\xfe", b'{"images": 3}', b"[" * 5000])
def test_a_file_that_is_no_coco_is_a_one_line_error(tmp_path, content):
    (tmp_path / "a.json").write_bytes(content)
    with pytest.raises(FormatError, match=r"a\.json") as caught:
        read_coco(tmp_path / "a.json")
    assert "\n" not in str(caught.value)


json_values = st.recursive(
    st.none() | st.booleans() | st.integers(-2, 8) | st.floats() | st.sampled_from(["", "rock", "04", f"{KEY}.png"]),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.sampled_from(["size", "counts", "rock", "id", "name"]), inner, max_size=3)
    ),
    max_leaves=8,
)


@settings(deadline=None, max_examples=40)
@given(values=st.dictionaries(st.sampled_from(["bbox", "segmentation", "rock", "attributes", "id"]), json_values))
def test_any_annotation_is_read_or_a_one_line_error(tmp_path_factory, values):
    path = foreign(tmp_path_factory.mktemp("coco"), annotation=values)
    reason = f"{path}: "
    try:
        ((found,),) = read_coco(path).values()
        assert found.kind == ROCK
        assert np.isfinite(found.box).all()
    except FormatError as error:
        reason = str(error)
    assert reason.startswith(f"{path}: ")
    assert "\n" not in reason
