"""Annotations of Label Studio: JSON (tasks with annotations or predictions) and JSON-MIN (a row per task)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.annotate.export_files import OTHER_SITE, ExportedImage, ExportedShape, key_in, scale_of
from polarsim.errors import FormatError, with_part
from polarsim.formats.files import read_json
from polarsim.formats.readers import reading
from polarsim.geometry.boxes import box_around_points, box_of_ellipse, box_of_mask
from polarsim.site import Site

_NAME_FIELDS = ("key", "image")  # fields of a task that usually contain the image name; searched first
_GEOMETRY = ("x", "y", "width", "height", "radiusX", "radiusY", "rotation", "points", "rle", "imageDataURL")
_MAX_BRUSH_VALUES = 4 * 100_000_000  # four channels
PREDICTION = "prediction without an annotation"
EARLIER = "earlier annotation of a task"


def read_label_studio(source: Path, site: Site) -> Iterator[ExportedImage]:
    """Read the images and regions of an export.

    The last annotation of a task that was not cancelled is used. Predictions are used only in a file without
    annotations, such as the tasks written by `polarsim export`.
    """
    tasks = read_json(source)
    if not isinstance(tasks, list) or not all(isinstance(task, dict) for task in tasks):
        raise FormatError("no Label Studio export: expected a list of tasks")
    if tasks and "image_id" in tasks[0]:
        raise FormatError(
            "a list of COCO results without image names: import the file with images, categories and annotations"
        )
    annotated = any(isinstance(task.get("annotations"), list) for task in tasks)
    for number, task in enumerate(tasks, 1):
        with with_part(f"task {number}"):
            name = _name(task, site)
        with with_part(name):
            regions, unread = _regions(task, annotated)
            shapes = [_shape(index, region, site.images.size) for index, region in enumerate(_merged(regions), 1)]
        yield ExportedImage(name, [*shapes, *unread])


def is_predicted(source: Path) -> bool:
    """Return whether an export has predictions and no annotations."""
    tasks = read_json(source)
    return any("predictions" in task for task in tasks) and not any("annotations" in task for task in tasks)


def _name(task: Mapping[str, Any], site: Site) -> str:
    """Return the image name of a task: the field that contains a photo key."""
    data = task.get("data", task)
    fields = {field: value for field, value in data.items() if isinstance(value, str)} if isinstance(data, dict) else {}
    order = (*_NAME_FIELDS, *sorted(set(fields) - set(_NAME_FIELDS)))
    named = {field: key for field in order if (key := key_in(fields.get(field, ""), site))}
    if not named:
        examples = ", ".join(f"{field}: {value[:60]!r}" for field, value in list(fields.items())[:4])
        raise FormatError(
            f"no field contains a photo key of the site {site.name} ({examples or 'no text field'}); {OTHER_SITE}"
        )
    if len(set(named.values())) > 1:
        raise FormatError(f"fields {' and '.join(named)} have different photo keys, expected the same key")
    return fields[next(iter(named))]


def _regions(task: Mapping[str, Any], annotated: bool) -> tuple[list[dict[str, Any]], list[ExportedShape]]:
    """Return the regions of a task, with id and the fields of `value`, and the skipped annotations and predictions."""
    if not annotated and "predictions" not in task and "annotations" not in task:
        return _minimal(task), []
    listed = task.get("annotations" if annotated else "predictions") or []
    results = [_results(entry) for entry in listed if not entry.get("was_cancelled")]
    unread = [ExportedShape("", EARLIER, "", None) for _ in results[:-1]] if annotated else []
    if annotated and not results:
        predicted = [
            entry for entry in task.get("predictions") or [] if isinstance(entry, dict) and entry.get("result")
        ]
        unread += [ExportedShape("", PREDICTION, "", None) for _ in predicted]
    regions = []
    for result in results[-1] if results else []:
        if result.get("type") == "relation":  # between two regions
            continue
        value = result.get("value")
        value = dict(value) if isinstance(value, dict) else {}
        common = {field: result[field] for field in ("id", "type", "original_width", "original_height",
                  "image_rotation") if field in result}  # fmt: skip
        regions.append({**common, **value})
    return regions, unread


def _results(annotation: Any) -> list[dict[str, Any]]:
    results = annotation.get("result") if isinstance(annotation, dict) else None
    if not isinstance(results, list) or not all(isinstance(result, dict) for result in results):
        raise FormatError("an annotation has no list `result`, expected a Label Studio export")
    return results


def _minimal(task: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the regions of a row of JSON-MIN: all lists, whose keys are names of the labelling interface."""
    lists = [value for field, value in task.items() if field != "data" and isinstance(value, list)]
    return [dict(region) for value in lists for region in value if isinstance(region, dict)]


def _merged(regions: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Join results of the same region: `Rectangle` and `Labels` are two results with equal id or geometry."""
    merged: dict[object, dict[str, Any]] = {}
    for number, region in enumerate(regions):
        geometry = repr([region[field] for field in _GEOMETRY if field in region])
        has_geometry = any(field in region for field in _GEOMETRY)
        name = region.get("id") or (geometry if has_geometry else number)
        form = merged[name]["type"] if name in merged and merged[name].get("type") in _FORMS else None
        merged[name] = {**merged.get(name, {}), **region, **({"type": form} if form else {})}
    return list(merged.values())


_GEOMETRIC_FORMS = ("rectangle", "rotated rectangle", "polygon", "ellipse", "brush", "keypoint")
_FORMS = {name: form for form in _GEOMETRIC_FORMS for name in (form, f"{form}labels")}


def _shape(index: int, region: Mapping[str, Any], size: tuple[int, int]) -> ExportedShape:
    where = f"region {index}"
    labels = [
        str(label)
        for field, value in region.items()
        if field.endswith("labels") and isinstance(value, list)
        for label in value
    ]
    form = _form(region)
    if len(set(labels)) > 1:
        raise FormatError(f"{where}: labels {' and '.join(labels)}, expected a single label")
    if not labels:
        return ExportedShape(where, f"{form} without a label" if form in _GEOMETRIC_FORMS else form, "", None)
    if region.get("image_rotation"):
        return ExportedShape(where, f"{form} on a rotated image", labels[0], None)
    if "original_width" in region and "original_height" in region:
        with reading("size"):
            scale_of(float(region["original_width"]), float(region["original_height"]), size)
    with with_part(where), reading(form):
        return ExportedShape(where, form, labels[0], _box(form, region, size))


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


def _box(form: str, region: Mapping[str, Any], size: tuple[int, int]) -> np.ndarray | None:
    """Return the bounding box (4,) of a region, px of a photo of a size; lengths are percentages of width or height."""
    photo = np.array(size, float)
    rotation = float(region.get("rotation") or 0)
    missing = [field for field in _NEEDED.get(form, ()) if field not in region]
    if missing:
        raise FormatError(f"missing fields: {', '.join(missing)}")
    if form in ("rectangle", "rotated rectangle"):
        across, down = float(region["width"]) * size[0], float(region["height"]) * size[1]
        if across <= 0 or down <= 0:
            raise FormatError(f"width {region['width']} and height {region['height']}, expected more than 0")
        corners = np.array([[0, 0], [across, 0], [across, down], [0, down]])  # hundredths of a pixel
        cos, sin = np.cos(np.radians(rotation)), np.sin(np.radians(rotation))
        corners = corners @ np.array([[cos, sin], [-sin, cos]])  # about the upper left corner
        return box_around_points((corners / photo + [float(region["x"]), float(region["y"])]) * photo / 100)
    if form == "polygon":
        return box_around_points(np.array(region["points"], float).reshape(-1, 2) * photo / 100)
    if form == "ellipse":
        centre, radii = (
            np.array([float(region[field]) for field in fields]) * photo / 100
            for fields in (("x", "y"), ("radiusX", "radiusY"))
        )
        return box_of_ellipse(centre, radii, rotation)
    if form == "brush" and "rle" in region:
        width, height = int(region["original_width"]), int(region["original_height"])
        painted = decode_brush(region["rle"], width * height * 4).reshape(height, width, 4)[..., 3] > 0
        box = box_of_mask(painted)
        if box is None:
            raise FormatError("the brush mask is empty")
        return box * (size[0] / width)
    return None


def decode_brush(packed: Sequence[int], count: int) -> np.ndarray:
    """Decode the runs of a brush to values (count,): red, green, blue and opacity of each pixel, row by row.

    The format is that of `@thi.ng/rle-pack`. The header has the number of values (32 bits), the number of bits of a
    value minus 1 (5 bits), and four times the number of bits of a length minus 1 (4 bits each). Each run has a flag for
    a repeated value (1 bit), the index of the number of bits of the length (2 bits), the length minus 1, and the
    repeated value or all values of the run.
    """
    bits = np.unpackbits(np.array(packed, np.uint8))
    offset = 0

    def number(width: int) -> int:
        nonlocal offset
        if offset + width > len(bits):
            raise FormatError("the runs of a brush are truncated")
        value = 0
        for bit in bits[offset : offset + width].tolist():
            value = 2 * value + bit
        offset += width
        return value

    stated = number(32)
    if stated != count or count > _MAX_BRUSH_VALUES:
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
            if offset + length * word > len(bits):
                raise FormatError("the runs of a brush are truncated")
            words = bits[offset : offset + length * word].reshape(length, word).astype(np.int64)
            values[filled : filled + length] = words @ (1 << np.arange(word - 1, -1, -1))
            offset += length * word
        filled += length
    return values
