"""Label Studio's tasks with rectangles as predictions, and the labelling interface that shows them.

Places and sizes are percent of the picture's; a prediction becomes an annotation as soon as a person edits it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from polarsim.geometry.boxes import clip
from polarsim.photo import HEIGHT, NO_ROCK, ROCK, SHADOW, WIDTH, PhotoKey

DECIMALS = 6  # of a percent: a hundred-thousandth of a pixel
LOCAL_FILES = "/data/local-files/?d="  # how Label Studio names pictures below its document root
_RECTANGLES, _IMAGE = "label", "image"  # names of the interface's parts


def interface(colours: dict[str, str]) -> str:
    """The labelling interface (XML) for tasks of `tasks`; colours by kind as "#rrggbb"."""
    labels = "\n".join(f'    <Label value="{kind}" background="{colour}"/>' for kind, colour in colours.items())
    return (
        f'<View>\n  <Image name="{_IMAGE}" value="${_IMAGE}" zoom="true"/>\n'
        f'  <RectangleLabels name="{_RECTANGLES}" toName="{_IMAGE}" canRotate="false" strokeWidth="2">\n'
        f"{labels}\n  </RectangleLabels>\n</View>\n"
    )


def tasks(labels: pd.DataFrame, keys: Sequence[PhotoKey], pictures: str) -> list[dict[str, Any]]:
    """A task a photo: its picture, and its labels as one prediction, shadows tied to their rocks.

    Parameters
    ----------
    labels
        Label rows; those of other photos are passed over. Boxes are cut at the photo's border.
    keys
        The photos, in the order of the tasks, those without labels too.
    pictures
        Folder of the pictures `KEY.png` below Label Studio's document root, as in an address (no bare spaces).
    """
    by_key = dict(tuple(labels.groupby("key", sort=False)))
    none = labels.iloc[:0]
    return [_task(key, by_key.get(str(key), none), f"{LOCAL_FILES}{pictures}/{key}.png") for key in keys]


def _task(key: PhotoKey, rows: pd.DataFrame, picture: str) -> dict[str, Any]:
    boxes = clip(rows[["x0", "y0", "x1", "y1"]].to_numpy(float)) / [WIDTH, HEIGHT, WIDTH, HEIGHT] * 100
    result = [
        _rectangle(f"{key}_{number}", row, box)
        for number, (row, box) in enumerate(zip(rows.to_dict("records"), boxes, strict=True), 1)
    ]
    score = round(float(rows["confidence"].mean()), 4) if len(rows) else 1.0
    prediction = {"model_version": "polarsim", "score": score, "result": [*result, *_relations(key, rows)]}
    return {"data": {_IMAGE: picture, "key": str(key)}, "predictions": [prediction]}


def _rectangle(name: str, row: dict[Any, Any], box: np.ndarray) -> dict[str, Any]:
    x0, y0, x1, y1 = box.tolist()
    kind, rock = str(row["kind"]), int(row["rock"])
    place = {"x": x0, "y": y0, "width": x1 - x0, "height": y1 - y0}
    return {
        "id": name,
        "type": "rectanglelabels",
        "from_name": _RECTANGLES,
        "to_name": _IMAGE,
        "original_width": WIDTH,
        "original_height": HEIGHT,
        "image_rotation": 0,
        "score": round(float(row["confidence"]), 4),
        "value": {k: round(v, DECIMALS) for k, v in place.items()} | {"rotation": 0, "rectanglelabels": [kind]},
        "meta": {"text": [f"rock {rock}"] if rock != NO_ROCK else []},
    }


def _relations(key: PhotoKey, rows: pd.DataFrame) -> list[dict[str, Any]]:
    """From every shadow to the first rock of its number."""
    labelled = list(zip(rows["kind"], rows["rock"], range(1, len(rows) + 1), strict=True))
    rocks = {rock: number for kind, rock, number in reversed(labelled) if kind == ROCK and rock != NO_ROCK}
    return [
        {"type": "relation", "from_id": f"{key}_{number}", "to_id": f"{key}_{rocks[rock]}", "direction": "right"}
        for kind, rock, number in labelled
        if kind == SHADOW and rock in rocks
    ]
