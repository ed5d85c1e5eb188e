import contextlib
import io

import numpy as np
import pytest
import yaml

from polarsim.formats import png, yolo
from polarsim.photo import BOX_CLASSES
from tests.publish.tiny import SIZE

pytest.importorskip("pycocotools")
from pycocotools.coco import COCO

PARTS = ("train", "test")


def silently(call, *arguments):
    with contextlib.redirect_stdout(io.StringIO()):
        return call(*arguments)


def test_coco_masks_are_read_back_exactly_and_shadows_refer_to_rocks(published, catalogue):
    from pycocotools import mask as runs

    folder, seen = published("coco"), 0
    for domain in catalogue.domains:
        by_name = {f"{one.name}.png": one for one in catalogue.of_domain(domain)}
        for part in PARTS:
            found = silently(COCO, folder / f"annotations/{domain}_{part}.json")
            for image in found.imgs.values():
                picture = by_name[image["file_name"]]
                content = (folder / "images" / image["file_name"]).read_bytes()
                assert content == picture.path.read_bytes()
                labels = catalogue.labels(picture)
                rows = found.imgToAnns[image["id"]]
                for one, row in zip(labels, rows, strict=True):
                    np.testing.assert_array_equal(found.annToMask(row).astype(bool), one.mask.mask())
                    np.testing.assert_allclose(runs.toBbox(row["segmentation"]), row["bbox"], atol=1e-3)
                    if one.amodal:
                        whole = runs.decode(row["amodal_segmentation"]).astype(bool)
                        np.testing.assert_array_equal(whole, one.amodal.mask.mask())
                thrown = {row["shadow_of"] for row in rows if "shadow_of" in row}
                assert thrown == {row["id"] for row in rows if row["category_id"] == 1 and row["rock"] in (4, 7)}
                seen += 1
    assert seen == len(catalogue.pictures)


def test_yolo_boxes_are_accurate_to_a_hundredth_of_a_pixel(published, catalogue):
    folder = published("yolo")
    for domain in catalogue.domains:
        stated = yaml.safe_load((folder / f"{domain}.yaml").read_text())
        assert stated["names"] == dict(enumerate(BOX_CLASSES))
        for one in catalogue.of_domain(domain):
            images = folder / stated["path"] / stated[one.part]
            picture = png.read_png(images / f"{one.key}.png")
            assert (picture.shape, picture.dtype) == (SIZE[::-1], np.uint8)
            text = str(images / f"{one.key}.txt").replace("/images/", "/labels/")  # rule of YOLO trainers
            classes, boxes = yolo.read_boxes(text, SIZE)
            labels = catalogue.labels(one)
            assert [BOX_CLASSES[number] for number in classes] == [label.kind for label in labels]
            np.testing.assert_allclose(boxes, [label.box for label in labels], atol=0.01, rtol=0)
