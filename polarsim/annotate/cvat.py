"""Annotations of CVAT for images 1.1 (XML)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from polarsim.annotate.shapes import ExportedImage, ExportedShape, scale_of
from polarsim.errors import FormatError
from polarsim.formats.readers import reading
from polarsim.geometry.boxes import box_around_points, box_of_ellipse, box_of_mask, rotated_box

_CORNERS = [f"{axis}{corner}" for corner in ("tl1", "bl1", "tr1", "br1", "tl2", "bl2", "tr2", "br2") for axis in "xy"]
_MAX_MASK_PX = 1e8


def read_cvat(source: Path) -> Iterator[ExportedImage]:
    """Read the images and shapes of an XML file."""
    with reading("XML", source):
        root = ElementTree.parse(source).getroot()  # noqa: S314  # expat stops entities that blow up
    if root.tag != "annotations":
        voc = " (Pascal VOC)" if root.tag == "annotation" else ""
        reason = f"<{root.tag}>{voc}, expected CVAT for images 1.1: export in this format or as COCO"
        raise FormatError(reason, path=source)
    tracks = len(root.findall("track"))
    if tracks:
        raise FormatError(
            f"CVAT for video 1.1 with {tracks} tracks, in which frames have no image names: export the task as "
            "CVAT for images 1.1",
            path=source,
        )
    for number, image in enumerate(root.iter("image")):
        name = image.get("name") or ""
        if not name:
            raise FormatError(f"<image> {number + 1} has no name", path=source)
        scale = scale_of(source, name, *(_number(source, name, image, side) for side in ("width", "height")))
        yield ExportedImage(name, [_shape(source, name, index, child, scale) for index, child in enumerate(image, 1)])


def _shape(source: Path, name: str, index: int, element: ElementTree.Element, scale: float) -> ExportedShape:
    where = f"<{element.tag}> {index}"
    form, box = _form_and_box(source, f"{name}, {where}", element)
    return ExportedShape(where, form, element.get("label") or "", None if box is None else box * scale)


def _form_and_box(source: Path, where: str, element: ElementTree.Element) -> tuple[str, np.ndarray | None]:
    """Return the form of an element and the bounding box (4,), px of the image; None for forms without box."""

    def number(attribute: str, default: float | None = None) -> float:
        return _number(source, where, element, attribute, default)

    rotation = number("rotation", 0.0)
    if element.tag == "box":
        box = np.array([number(edge) for edge in ("xtl", "ytl", "xbr", "ybr")])
        if (box[2:] <= box[:2]).any():
            raise FormatError(f"{where}: corners {box.tolist()}, expected xtl < xbr and ytl < ybr", path=source)
        return ("rotated box", rotated_box(box, rotation)) if rotation else ("box", box)
    if element.tag == "ellipse":
        centre, radii = np.array([number("cx"), number("cy")]), np.array([number("rx"), number("ry")])
        return "ellipse", box_of_ellipse(centre, radii, rotation)
    if element.tag in ("polygon", "polyline"):
        points = _points(source, where, element)
        if element.tag == "polyline" and len(points) > 3 and (points[0] == points[-1]).all():
            return "closed polyline", box_around_points(points)
        return element.tag, box_around_points(points) if element.tag == "polygon" else None
    if element.tag == "mask":
        left, top, width, height = (number(edge) for edge in ("left", "top", "width", "height"))
        covered = _mask(source, where, element.get("rle") or "", int(width), int(height))
        return "mask", covered + np.array([left, top, left, top])
    if element.tag == "cuboid":
        return "cuboid", box_around_points(np.array([number(corner) for corner in _CORNERS]).reshape(-1, 2))
    return element.tag, None  # points, skeleton, tag


def _mask(source: Path, where: str, rle: str, width: int, height: int) -> np.ndarray:
    """Return the bounding box (4,) of a mask in a window: lengths of runs along the rows, background first."""
    with reading(f"mask of {where}", source):
        runs = np.array([int(run) for run in rle.split(",")])
    if not 0 < width * height <= _MAX_MASK_PX or (runs < 0).any() or runs.sum() != width * height:
        raise FormatError(f"{where}: runs of {runs.sum()} pixels, expected {width} x {height}", path=source)
    box = box_of_mask(np.repeat(np.arange(len(runs)) % 2 == 1, runs).reshape(height, width))
    if box is None:
        raise FormatError(f"{where}: the mask is empty", path=source)
    return box


def _points(source: Path, where: str, element: ElementTree.Element) -> np.ndarray:
    """Return points (n, 2), px of the image."""
    with reading(f"points of {where}", source):
        text = element.get("points") or ""
        points = np.array([[float(value) for value in point.split(",")] for point in text.split(";")])
    if points.ndim != 2 or points.shape[1] != 2:
        raise FormatError(f"{where}: points {text[:40]!r}, expected x,y;x,y;...", path=source)
    return points


def _number(
    source: Path, where: str, element: ElementTree.Element, attribute: str, default: float | None = None
) -> float:
    text = element.get(attribute)
    if text is None and default is not None:
        return default
    try:
        value = float(text or "")
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise FormatError(f"{where}: {attribute} is {'missing' if text is None else repr(text)}", path=source)
    return value
