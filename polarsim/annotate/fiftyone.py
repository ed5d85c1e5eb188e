"""Annotations of FiftyOne: samples.json (FiftyOneDataset) and labels.json (FiftyOneImageDetectionDataset)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.annotate.shapes import SIZE, Picture, Shape
from polarsim.errors import FormatError, within
from polarsim.formats.files import read_json
from polarsim.formats.readers import reading
from polarsim.geometry.boxes import around, turned

GROUND_TRUTH = "ground_truth"
_LISTS = {
    "Detections": "detections",
    "Polylines": "polylines",
    "Keypoints": "keypoints",
    "Classifications": "classifications",
}
_SINGLE = ("Detection", "Polyline", "Keypoint", "Classification", "Segmentation", "Heatmap")
_DRAWN = ("Detection", "Detections", "Polyline", "Polylines")


def read_fiftyone(source: Path) -> Iterator[Picture]:
    """Read the pictures and labels of a file.

    A sample's labels are those of its field `ground_truth`, or of its only field with boxes or polylines.

    Raises
    ------
    FormatError
        Several fields and no `ground_truth`, or a broken label.
    """
    content = read_json(source)
    if not isinstance(content, dict):
        raise FormatError("no FiftyOne data set: expected samples or labels", path=source)
    if "samples" in content:
        for number, sample in enumerate(content["samples"], 1):
            name = sample.get("filepath") if isinstance(sample, dict) else None
            if not isinstance(name, str):
                raise FormatError(f"sample {number} without a filepath", path=source)
            yield Picture(name, _of_sample(source, name, sample))
        return
    classes = content.get("classes") or ()
    for name, detections in content["labels"].items():
        if isinstance(detections, dict | str):
            raise FormatError(f"{name}: expected a list of detections", path=source)
        yield Picture(name, [_shape(source, name, i, one, classes) for i, one in enumerate(detections or (), 1)])


def _of_sample(source: Path, name: str, sample: Mapping[str, Any]) -> list[Shape]:
    fields = {
        field: value
        for field, value in sample.items()
        if isinstance(value, dict) and value.get("_cls") in (*_LISTS, *_SINGLE)
    }
    drawn = [field for field, value in fields.items() if value["_cls"] in _DRAWN]
    if len(drawn) > 1 and GROUND_TRUTH not in drawn:
        raise FormatError(f"fields {', '.join(sorted(drawn))}: call one of them {GROUND_TRUTH}", path=source)
    chosen = GROUND_TRUTH if GROUND_TRUTH in fields else next(iter(drawn), None)
    shapes = []
    for field, value in fields.items():
        listed = value.get(_LISTS[value["_cls"]]) if value["_cls"] in _LISTS else [value]
        own = [_shape(source, name, number, one, ()) for number, one in enumerate(listed or (), 1)]
        shapes += own if field == chosen else [Shape("", f"{one.form} in the field {field}", "", None) for one in own]
    return shapes


def _shape(source: Path, name: str, number: int, label: Any, classes: Sequence[str]) -> Shape:
    """Lengths are shares of the picture's width or height."""
    if not isinstance(label, dict):
        raise FormatError(f"{name}: label {number} is no detection", path=source)
    form = str(label.get("_cls") or ("Detection" if "bounding_box" in label else "label")).lower()
    where = f"{form} {number}"
    with within(f"{name}, {where}"), reading(form, source):
        called = label.get("label")
        if isinstance(called, int) and classes:
            if not 0 <= called < len(classes):
                raise FormatError(f"class {called}, the list has {len(classes)}")
            called = classes[called]
        if form == "detection":
            x, y, width, height = map(float, _needed(label, "bounding_box"))
            if width <= 0 or height <= 0:
                raise FormatError(f"bounding_box {label['bounding_box']}, expected width and height above 0")
            box = np.array([x, y, x + width, y + height]) * np.tile(SIZE, 2)
            rotation = _rotation(label)
            return Shape(where, "rotated box" if rotation else "box", str(called), turned(box, rotation))
        if form == "polyline":
            if not (label.get("closed") or label.get("filled")):
                return Shape(where, "polyline", str(called), None)
            points = np.array([point for part in _needed(label, "points") for point in part], float).reshape(-1, 2)
            return Shape(where, "polygon", str(called), around(points * SIZE))
    return Shape(where, form, str(called), None)


def _needed(label: Mapping[str, Any], field: str) -> Any:
    if field not in label:
        raise FormatError(f"{field} missing")
    return label[field]


def _rotation(label: Mapping[str, Any]) -> float:
    """Degrees about the centre, where FiftyOne keeps CVAT's attribute."""
    attributes = label.get("attributes")
    stated = attributes.get("rotation") if isinstance(attributes, dict) else None
    value = stated.get("value") if isinstance(stated, dict) else stated
    return float(value if value is not None else label.get("rotation") or 0)
