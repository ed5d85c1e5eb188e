"""Annotations of FiftyOne: samples.json (FiftyOneDataset) and labels.json (FiftyOneImageDetectionDataset)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.annotate.shapes import SIZE, ExportedImage, ExportedShape
from polarsim.errors import FormatError, with_part
from polarsim.formats.files import read_json
from polarsim.formats.readers import reading
from polarsim.geometry.boxes import box_around_points, rotated_box

GROUND_TRUTH = "ground_truth"
_LISTS = {
    "Detections": "detections",
    "Polylines": "polylines",
    "Keypoints": "keypoints",
    "Classifications": "classifications",
}
_SINGLE = ("Detection", "Polyline", "Keypoint", "Classification", "Segmentation", "Heatmap")
_WITH_BOX = ("Detection", "Detections", "Polyline", "Polylines")


def read_fiftyone(source: Path) -> Iterator[ExportedImage]:
    """Read the images and labels of a file.

    Labels are read from the field `ground_truth` of a sample, or from the only field with boxes or polylines.

    Raises
    ------
    FormatError
        A sample has several fields with boxes and no `ground_truth`, or a label is invalid.
    """
    content = read_json(source)
    if not isinstance(content, dict):
        raise FormatError("no FiftyOne data set: expected samples or labels", path=source)
    if "samples" in content:
        for number, sample in enumerate(content["samples"], 1):
            name = sample.get("filepath") if isinstance(sample, dict) else None
            if not isinstance(name, str):
                raise FormatError(f"sample {number} has no filepath", path=source)
            yield ExportedImage(name, _of_sample(source, name, sample))
        return
    classes = content.get("classes") or ()
    for name, detections in content["labels"].items():
        if isinstance(detections, dict | str):
            raise FormatError(f"{name}: expected a list of detections", path=source)
        shapes = [_shape(source, name, number, label, classes) for number, label in enumerate(detections or (), 1)]
        yield ExportedImage(name, shapes)


def _of_sample(source: Path, name: str, sample: Mapping[str, Any]) -> list[ExportedShape]:
    fields = {
        field: value
        for field, value in sample.items()
        if isinstance(value, dict) and value.get("_cls") in (*_LISTS, *_SINGLE)
    }
    boxed = [field for field, value in fields.items() if value["_cls"] in _WITH_BOX]
    if len(boxed) > 1 and GROUND_TRUTH not in boxed:
        reason = f"fields {', '.join(sorted(boxed))} have labels: rename the correct field to {GROUND_TRUTH}"
        raise FormatError(reason, path=source)
    chosen = GROUND_TRUTH if GROUND_TRUTH in fields else next(iter(boxed), None)
    shapes = []
    for field, value in fields.items():
        listed = value.get(_LISTS[value["_cls"]]) if value["_cls"] in _LISTS else [value]
        of_field = [_shape(source, name, number, label, ()) for number, label in enumerate(listed or (), 1)]
        if field != chosen:
            of_field = [ExportedShape("", f"{shape.form} in the field {field}", "", None) for shape in of_field]
        shapes += of_field
    return shapes


def _shape(source: Path, name: str, number: int, label: Any, classes: Sequence[str]) -> ExportedShape:
    """Return the shape of a label, in which lengths are shares of the image width or height."""
    if not isinstance(label, dict):
        raise FormatError(f"{name}: label {number} is not a detection", path=source)
    form = str(label.get("_cls") or ("Detection" if "bounding_box" in label else "label")).lower()
    where = f"{form} {number}"
    with with_part(f"{name}, {where}"), reading(form, source):
        kind = label.get("label")
        if isinstance(kind, int) and classes:
            if not 0 <= kind < len(classes):
                raise FormatError(f"class {kind}, expected a number below {len(classes)}")
            kind = classes[kind]
        if form == "detection":
            x, y, width, height = map(float, _needed(label, "bounding_box"))
            if width <= 0 or height <= 0:
                raise FormatError(f"bounding_box {label['bounding_box']}, expected width and height above 0")
            box = np.array([x, y, x + width, y + height]) * np.tile(SIZE, 2)
            rotation = _rotation(label)
            return ExportedShape(where, "rotated box" if rotation else "box", str(kind), rotated_box(box, rotation))
        if form == "polyline":
            if not (label.get("closed") or label.get("filled")):
                return ExportedShape(where, "polyline", str(kind), None)
            points = np.array([point for part in _needed(label, "points") for point in part], float).reshape(-1, 2)
            return ExportedShape(where, "polygon", str(kind), box_around_points(points * SIZE))
    return ExportedShape(where, form, str(kind), None)


def _needed(label: Mapping[str, Any], field: str) -> Any:
    if field not in label:
        raise FormatError(f"the field {field} is missing")
    return label[field]


def _rotation(label: Mapping[str, Any]) -> float:
    """Return the rotation about the centre, degrees, from the field in which FiftyOne stores CVAT's attribute."""
    attributes = label.get("attributes")
    stated = attributes.get("rotation") if isinstance(attributes, dict) else None
    value = stated.get("value") if isinstance(stated, dict) else stated
    return float(value if value is not None else label.get("rotation") or 0)
