import json

import numpy as np

from polarsim.annotate.export import cvat_labels
from polarsim.formats import coco
from polarsim.formats.coco_annotations import Annotation
from polarsim.photo import PhotoKey
from polarsim.site import polar

POLAR = polar()
SIZE = POLAR.images.size


def test_every_attribute_is_declared_because_cvat_drops_undeclared_attributes(tmp_path):
    box = Annotation("rock", 7, np.array([100.0, 200, 150, 230]), None, "fused", 0.8)
    coco.write_coco(tmp_path / "boxes.json", {PhotoKey.parse("01_A_off_30_L_0256"): [box]}, POLAR, SIZE)
    written = json.loads((tmp_path / "boxes.json").read_text())["annotations"][0]
    assert written["attributes"] == {"rock": 7, "confidence": 0.8, "label_source": "fused"}
    assert written["segmentation"] == []  # otherwise CVAT imports polygons instead of rectangles
    for entry in cvat_labels():
        assert {attribute["name"] for attribute in entry["attributes"]} == set(written["attributes"])


def test_a_source_in_attributes_reads_back(tmp_path):
    content = {
        "images": [{"id": 1, "file_name": "01_A_off_30_L_0256.png"}],
        "categories": [{"id": 1, "name": "rock"}],
        "annotations": [
            {"image_id": 1, "category_id": 1, "bbox": [10, 20, 30, 40], "attributes": {"label_source": "fused"}}
        ],
    }
    (tmp_path / "boxes.json").write_text(json.dumps(content))
    ((read,),) = coco.read_coco(tmp_path / "boxes.json", SIZE, POLAR.key_of_picture).values()
    assert read.source == "fused"
