"""Annotations of CVAT for images 1.1 (XML)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from polarsim.annotate.export_files import ExportedImage, ExportedShape, scale_of
from polarsim.errors import FormatError, with_part
from polarsim.formats.readers import reading
from polarsim.geometry.boxes import box_around_points, box_of_ellipse, box_of_mask, rotated_box

_CORNERS = [f"{axis}{corner}" for corner in ("tl1", "bl1", "tr1", "br1", "tl2", "bl2", "tr2", "br2") for axis in "xy"]
_MAX_MASK_PX = 1e8
_Element = ElementTree.Element


def read_cvat(source: Path, size: tuple[int, int]) -> Iterator[ExportedImage]:
    """Read the images and shapes of an XML file; images can be photos of a size in px at any scale."""
    with reading("XML", source):
        root = ElementTree.parse(source).getroot()  # noqa: S314  # expat stops entities that blow up
    if root.tag != "annotations":
        voc = " (Pascal VOC)" if root.tag == "annotation" else ""
        raise FormatError(f"<{root.tag}>{voc}, expected CVAT for images 1.1: export in this format or as COCO")
    if tracks := len(root.findall("track")):
        raise FormatError(
            f"CVAT for video 1.1 with {tracks} tracks, in which frames have no image names: export the task as "
            "CVAT for images 1.1"
        )
    for number, image in enumerate(root.iter("image"), 1):
        name = image.get("name")
        if not name:
            raise FormatError(f"<image> {number} has no name")
        with with_part(name):
            scale = scale_of(_number(image, "width"), _number(image, "height"), size)
            yield ExportedImage(name, [_shape(index, element, scale) for index, element in enumerate(image, 1)])


def _shape(index: int, element: _Element, scale: float) -> ExportedShape:
    where = f"<{element.tag}> {index}"
    with with_part(where):
        form, box = _form_and_box(element)
    return ExportedShape(where, form, element.get("label") or "", None if box is None else box * scale)


def _form_and_box(element: _Element) -> tuple[str, np.ndarray | None]:
    """Return the form of an element and the bounding box (4,), px of the image; None for forms without box."""

    def numbers(*attributes: str) -> np.ndarray:
        return np.array([_number(element, attribute) for attribute in attributes])

    rotation = _number(element, "rotation", "0")
    if element.tag == "box":
        box = numbers("xtl", "ytl", "xbr", "ybr")
        if (box[2:] <= box[:2]).any():
            raise FormatError(f"corners {box.tolist()}, expected xtl < xbr and ytl < ybr")
        return ("rotated box", rotated_box(box, rotation)) if rotation else ("box", box)
    if element.tag == "ellipse":
        return "ellipse", box_of_ellipse(numbers("cx", "cy"), numbers("rx", "ry"), rotation)
    if element.tag in ("polygon", "polyline"):
        points = _points(element.get("points") or "")
        if element.tag == "polyline" and len(points) > 3 and (points[0] == points[-1]).all():
            return "closed polyline", box_around_points(points)
        return element.tag, box_around_points(points) if element.tag == "polygon" else None
    if element.tag == "mask":
        left, top, width, height = numbers("left", "top", "width", "height")
        covered = _mask(element.get("rle") or "", int(width), int(height))
        return "mask", covered + np.array([left, top, left, top])
    if element.tag == "cuboid":
        return "cuboid", box_around_points(numbers(*_CORNERS).reshape(-1, 2))
    return element.tag, None  # points, skeleton, tag


def _mask(rle: str, width: int, height: int) -> np.ndarray:
    """Return the bounding box (4,) of a mask in a window: lengths of runs along the rows, background first."""
    with reading("mask"):
        runs = np.array([int(run) for run in rle.split(",")])
    if not 0 < width * height <= _MAX_MASK_PX or (runs < 0).any() or runs.sum() != width * height:
        raise FormatError(f"runs of {runs.sum()} pixels, expected {width} x {height}")
    box = box_of_mask(np.repeat(np.arange(len(runs)) % 2 == 1, runs).reshape(height, width))
    if box is None:
        raise FormatError("the mask is empty")
    return box


def _points(text: str) -> np.ndarray:
    """Return points (n, 2), px of the image."""
    with reading("points"):
        points = np.array([[float(value) for value in point.split(",")] for point in text.split(";")])
    if points.ndim != 2 or points.shape[1] != 2:
        raise FormatError(f"points {text[:40]!r}, expected x,y;x,y;...")
    return points


def _number(element: _Element, attribute: str, default: str = "") -> float:
    text = element.get(attribute, default)
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise FormatError(f"{attribute} is {repr(text) if text else 'missing'}")
    return value
