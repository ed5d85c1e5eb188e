"""Annotations of Label Studio: JSON (tasks with annotations or predictions) and JSON-MIN (one row per task)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.annotate.shapes import SIZE, Picture, Shape, scale_of
from polarsim.errors import FormatError, LabelError, within
from polarsim.formats.files import read_json
from polarsim.formats.readers import reading
from polarsim.geometry.boxes import around, around_ellipse, of_mask
from polarsim.photo import HEIGHT, WIDTH, PhotoKey

_NAME_FIELDS = ("key", "image")  # of a task's data; any other field may name the picture if these do not
_GEOMETRY = ("x", "y", "width", "height", "radiusX", "radiusY", "rotation", "points", "rle", "imageDataURL")
_MOST_VALUES = 4 * 100_000_000  # of a brush: four channels
PREDICTION = "prediction without an annotation"
EARLIER = "earlier annotation of a task"


def read_label_studio(source: Path) -> Iterator[Picture]:
    """Read the pictures and regions of an export.

    Of a task's annotations the last one counts that was not cancelled. Predictions count only in a file without any
    annotation, such as the tasks that `polarsim export` writes.

    Raises
    ------
    FormatError
        No list of tasks, a task without a photo's name, or a broken region.
    """
    tasks = read_json(source)
    if not isinstance(tasks, list) or not all(isinstance(task, dict) for task in tasks):
        raise FormatError("no Label Studio export: expected a list of tasks", path=source)
    if tasks and "image_id" in tasks[0]:
        raise FormatError(
            "a list of COCO results, which names no pictures: import the file with images, categories and annotations",
            path=source,
        )
    annotated = any(isinstance(task.get("annotations"), list) for task in tasks)
    for number, task in enumerate(tasks, 1):
        name = _name(source, number, task)
        regions, unread = _regions(source, name, task, annotated)
        shapes = [_shape(source, name, index, region) for index, region in enumerate(_merged(regions), 1)]
        yield Picture(name, [*shapes, *unread])


def is_predicted(source: Path) -> bool:
    """Return whether the labels of an export are predictions, for lack of any annotation."""
    tasks = read_json(source)
    return any("predictions" in task for task in tasks) and not any("annotations" in task for task in tasks)


def _name(source: Path, number: int, task: Mapping[str, Any]) -> str:
    """Name of a task's picture: the field that has a photo key."""
    data = task.get("data", task)
    fields = {field: value for field, value in data.items() if isinstance(value, str)} if isinstance(data, dict) else {}
    named = {}
    for field in (*_NAME_FIELDS, *sorted(set(fields) - set(_NAME_FIELDS))):
        try:
            named[field] = PhotoKey.of_picture(fields[field])
        except (LabelError, KeyError):
            continue
    if not named:
        some = ", ".join(f"{field}: {value[:60]!r}" for field, value in list(fields.items())[:4])
        raise FormatError(f"task {number}: no field is named by a photo key ({some or 'no text field'})", path=source)
    if len(set(named.values())) > 1:
        raise FormatError(
            f"task {number}: fields {' and '.join(named)} have different photo keys; keep one", path=source
        )
    return fields[next(iter(named))]


def _regions(
    source: Path, name: str, task: Mapping[str, Any], annotated: bool
) -> tuple[list[dict[str, Any]], list[Shape]]:
    """Regions of a task, each with its id and its value's fields, and what does not count."""
    if not annotated and "predictions" not in task and "annotations" not in task:
        return _minimal(task), []
    listed = task.get("annotations" if annotated else "predictions") or []
    results = [_results(source, name, one) for one in listed if not one.get("was_cancelled")]
    unread = [Shape("", EARLIER, "", None) for _ in results[:-1]] if annotated else []
    if annotated and not results:
        predicted = [one for one in task.get("predictions") or [] if isinstance(one, dict) and one.get("result")]
        unread += [Shape("", PREDICTION, "", None) for _ in predicted]
    regions = []
    for one in results[-1] if results else []:
        if one.get("type") == "relation":  # between two regions
            continue
        value = one.get("value")
        value = dict(value) if isinstance(value, dict) else {}
        own = {field: one[field] for field in ("id", "type", "original_width", "original_height", "image_rotation")
               if field in one}  # fmt: skip
        regions.append({**own, **value})
    return regions, unread


def _results(source: Path, name: str, annotation: Any) -> list[dict[str, Any]]:
    results = annotation.get("result") if isinstance(annotation, dict) else None
    if not isinstance(results, list) or not all(isinstance(one, dict) for one in results):
        raise FormatError(f"{name}: an annotation without a list `result`, no Label Studio export", path=source)
    return results


def _minimal(task: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Regions of a row of JSON-MIN: lists below the names of the labelling interface's controls, whatever these are."""
    lists = [value for field, value in task.items() if field != "data" and isinstance(value, list)]
    return [dict(one) for value in lists for one in value if isinstance(one, dict)]


def _merged(regions: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Join results of one region: `Rectangle` and `Labels` are two results with one id or one geometry."""
    merged: dict[object, dict[str, Any]] = {}
    for number, region in enumerate(regions):
        geometry = repr([region[field] for field in _GEOMETRY if field in region])
        drawn = any(field in region for field in _GEOMETRY)
        name = region.get("id") or (geometry if drawn else number)
        form = merged[name]["type"] if name in merged and merged[name].get("type") in _FORMS else None
        merged[name] = {**merged.get(name, {}), **region, **({"type": form} if form else {})}
    return list(merged.values())


_DRAWN = ("rectangle", "rotated rectangle", "polygon", "ellipse", "brush", "keypoint")
_FORMS = {
    name: form
    for form in _DRAWN
    for name in (form, f"{form}labels")
}  # fmt: skip


def _shape(source: Path, name: str, index: int, region: Mapping[str, Any]) -> Shape:
    where = f"region {index}"
    labels = [
        str(label)
        for field, value in region.items()
        if field.endswith("labels") and isinstance(value, list)
        for label in value
    ]
    form = _form(region)
    if len(set(labels)) > 1:
        raise FormatError(f"{name}, {where}: labels {' and '.join(labels)}, expected one", path=source)
    if not labels:
        return Shape(where, f"{form} without a label" if form in _DRAWN else form, "", None)
    if region.get("image_rotation"):
        return Shape(where, f"{form} on a turned picture", labels[0], None)
    if "original_width" in region and "original_height" in region:
        with reading(f"size of {name}", source):
            scale_of(source, name, float(region["original_width"]), float(region["original_height"]))
    with within(f"{name}, {where}"), reading(form, source):
        return Shape(where, form, labels[0], _box(form, region))


def _form(region: Mapping[str, Any]) -> str:
    stated = region.get("type")
    if stated in _FORMS:
        form = _FORMS[stated]
    elif "rle" in region:
        form = "brush"
    elif "radiusX" in region:
        form = "ellipse"
    elif "points" in region:
        form = "polygon"
    elif all(field in region for field in ("x", "y", "width", "height")):
        form = "rectangle"
    elif "keypointlabels" in region:
        form = "keypoint"
    else:
        lists = [field for field, value in region.items() if isinstance(value, list)]
        return str(stated or (lists[0] if lists else "region of unknown form"))
    return "rotated rectangle" if form == "rectangle" and float(region.get("rotation") or 0) else form


_NEEDED = {
    "rectangle": ("x", "y", "width", "height"),
    "rotated rectangle": ("x", "y", "width", "height"),
    "polygon": ("points",),
    "ellipse": ("x", "y", "radiusX", "radiusY"),
    "brush": ("original_width", "original_height"),
}


def _box(form: str, region: Mapping[str, Any]) -> np.ndarray | None:
    """(4,) box around a region in px of the photo; lengths are percent of the picture's width or height."""
    turn = float(region.get("rotation") or 0)
    missing = [field for field in _NEEDED.get(form, ()) if field not in region]
    if missing:
        raise FormatError(f"{', '.join(missing)} missing")
    if form in ("rectangle", "rotated rectangle"):
        across, down = float(region["width"]) * WIDTH, float(region["height"]) * HEIGHT
        if across <= 0 or down <= 0:
            raise FormatError(f"width {region['width']} and height {region['height']}, expected more than 0")
        corners = np.array([[0, 0], [across, 0], [across, down], [0, down]])  # hundredths of a pixel
        cos, sin = np.cos(np.radians(turn)), np.sin(np.radians(turn))
        corners = corners @ np.array([[cos, sin], [-sin, cos]])  # about the upper left corner
        return around((corners / SIZE + [float(region["x"]), float(region["y"])]) * SIZE / 100)
    if form == "polygon":
        return around(np.array(region["points"], float).reshape(-1, 2) * SIZE / 100)
    if form == "ellipse":
        centre, radii = (
            np.array([float(region[field]) for field in fields]) * SIZE / 100
            for fields in (("x", "y"), ("radiusX", "radiusY"))
        )
        return around_ellipse(centre, radii, turn)
    if form == "brush" and "rle" in region:
        width, height = int(region["original_width"]), int(region["original_height"])
        painted = decode_brush(region["rle"], width * height * 4).reshape(height, width, 4)[..., 3] > 0
        box = of_mask(painted)
        if box is None:
            raise FormatError("a brush without a painted pixel")
        return box * (WIDTH / width)
    return None


def decode_brush(packed: Sequence[int], count: int) -> np.ndarray:
    """Unpack the runs of a brush: (count,) values of the red, green, blue and opacity of pixels in rows.

    The format is that of `@thi.ng/rle-pack`: 32 bits with the number of values, 5 with the bits of a value less 1, four
    times 4 with the bits of a length less 1; then a bit that is 1 for a repeated value, 2 bits for the choice of the
    length's bits, the length less 1 and the value, or as many values as the length.

    Raises
    ------
    FormatError
        The runs are cut, or have another number of values.
    """
    bits = np.unpackbits(np.array(packed, np.uint8))
    place = 0

    def number(width: int) -> int:
        nonlocal place
        if place + width > len(bits):
            raise FormatError("a brush whose runs are cut")
        value = 0
        for bit in bits[place : place + width].tolist():
            value = 2 * value + bit
        place += width
        return value

    stated = number(32)
    if stated != count or count > _MOST_VALUES:
        raise FormatError(f"a brush of {stated} values, expected {count}")
    word, lengths = number(5) + 1, [number(4) + 1 for _ in range(4)]
    values = np.zeros(count, np.int64)
    filled = 0
    while filled < count:
        repeated = number(1)
        length = min(number(lengths[number(2)]) + 1, count - filled)
        if repeated:
            values[filled : filled + length] = number(word)
        else:
            if place + length * word > len(bits):
                raise FormatError("a brush whose runs are cut")
            words = bits[place : place + length * word].reshape(length, word).astype(np.int64)
            values[filled : filled + length] = words @ (1 << np.arange(word - 1, -1, -1))
            place += length * word
        filled += length
    return values
