import contextlib
import io

import pytest
from pycocotools.coco import COCO

from polarsim.formats import coco_boxes, cvat
from polarsim.formats.files import write_json
from polarsim.formats.tables import key_columns, label_table
from polarsim.photo import PhotoKey

KEYS = [PhotoKey.parse(f"01_A_off_30_{camera}_0256") for camera in "LR"]


def label(key, kind, rock, box, confidence=1.0):
    row = {"kind": kind, "rock": rock, "source": "fused", "confidence": confidence}
    return key_columns(key) | row | dict(zip(("x0", "y0", "x1", "y1"), map(float, box), strict=True))


LABELS = label_table(
    [
        label(KEYS[0], "rock", 7, (100, 200, 150, 230), 0.8),
        label(KEYS[0], "shadow", 7, (-5, 1200, 40, 1220.5)),
        label(PhotoKey.parse("01_B_off_30_L_0256"), "rock", 7, (1, 1, 9, 9)),
    ]
)


@pytest.fixture
def coco(tmp_path):
    """The document as COCO's own reader has it."""
    write_json(tmp_path / "instances_default.json", coco_boxes.boxes_document(LABELS, KEYS))
    with contextlib.redirect_stdout(io.StringIO()):
        return COCO(str(tmp_path / "instances_default.json"))


def test_a_box_is_corner_and_size_cut_at_the_border(coco):
    found = coco.loadAnns(coco.getAnnIds())
    assert [entry["bbox"] for entry in found] == [[100, 200, 50, 30], [0, 1200, 40, 16]]
    assert [entry["area"] for entry in found] == [1500, 640]
    assert all(entry["segmentation"] == [] for entry in found)  # else CVAT imports polygons, no rectangles


def test_photos_without_labels_are_there_and_labels_of_other_photos_are_not(coco):
    assert [image["file_name"] for image in coco.loadImgs(coco.getImgIds())] == [f"{key}.png" for key in KEYS]
    assert [len(coco.getAnnIds(imgIds=number)) for number in coco.getImgIds()] == [2, 0]


def test_no_class_has_number_0_which_importers_take_for_none(coco):
    assert {entry["name"]: entry["id"] for entry in coco.loadCats(coco.getCatIds())} == {"rock": 1, "shadow": 2}


def test_every_attribute_is_declared_to_cvat_which_drops_others(coco):
    attributes = coco.loadAnns(coco.getAnnIds())[0]["attributes"]
    assert attributes == {"rock": 7, "confidence": 0.8, "label_source": "fused"}
    for entry in cvat.label_list({"rock": "#ffb000", "shadow": "#46beff"}):
        assert {attribute["name"] for attribute in entry["attributes"]} == set(attributes)
