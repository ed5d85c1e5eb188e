"""Boxes as COCO instances without outlines: the rectangles that CVAT imports as "COCO 1.0"."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pandas as pd

from polarsim.geometry.boxes import clip
from polarsim.photo import BOX_CLASSES, HEIGHT, WIDTH, PhotoKey

DECIMALS = 3  # of a pixel
CATEGORY_IDS = {kind: number for number, kind in enumerate(BOX_CLASSES, 1)}  # importers take 0 for no class


def boxes_document(labels: pd.DataFrame, keys: Sequence[PhotoKey]) -> dict[str, Any]:
    """COCO's `instances` of some photos; pictures are called `KEY.png`.

    Parameters
    ----------
    labels
        Label rows; those of other photos are passed over. Boxes are cut at the photo's border.
    keys
        The photos, in the order of their ids, those without labels too.
    """
    image_ids = {str(key): number for number, key in enumerate(keys, 1)}
    rows = labels[labels["key"].isin(list(image_ids))]
    boxes = clip(rows[["x0", "y0", "x1", "y1"]].to_numpy(float)).round(DECIMALS)
    annotations = [
        _annotation(number, row, image_ids[str(row["key"])], box)
        for number, (row, box) in enumerate(zip(rows.to_dict("records"), boxes.tolist(), strict=True), 1)
    ]
    images = [{"id": n, "file_name": f"{key}.png", "width": WIDTH, "height": HEIGHT} for key, n in image_ids.items()]
    categories = [{"id": number, "name": kind, "supercategory": ""} for kind, number in CATEGORY_IDS.items()]
    return {"images": images, "annotations": annotations, "categories": categories, "info": {}, "licenses": []}


def _annotation(number: int, row: dict[Any, Any], image: int, box: list[float]) -> dict[str, Any]:
    x0, y0, x1, y1 = box
    width, height = round(x1 - x0, DECIMALS), round(y1 - y0, DECIMALS)
    return {
        "id": number,
        "image_id": image,
        "category_id": CATEGORY_IDS[str(row["kind"])],
        "bbox": [x0, y0, width, height],
        "area": round(width * height, DECIMALS),
        "segmentation": [],  # with outlines importers would make polygons of them
        "iscrowd": 0,
        "attributes": {
            "rock": int(row["rock"]),
            "confidence": round(float(row["confidence"]), 4),
            "label_source": str(row["source"]),  # CVAT reads "source" as the shape's own origin
        },
    }
