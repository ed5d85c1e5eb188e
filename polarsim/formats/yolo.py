"""YOLO label files: boxes `class x y w h` and polygons `class x1 y1 x2 y2 ...`, relative to the image size."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from polarsim.errors import FormatError, with_path
from polarsim.formats.class_lists import is_whole, plain
from polarsim.formats.files import lines_of, write_text
from polarsim.formats.readers import not_a_number, reader
from polarsim.geometry.boxes import box_around_points
from polarsim.photo import BOX_CLASSES, POLYGON_CLASSES, ROCK, PhotoKey, Terrain
from polarsim.wording import counted

Line = TypeVar("Line")
_MAX_OFFSET = 0.6  # maximum distance of a polygon from the image centre, as a share of the image width or height


class MalformedLinesError(FormatError):
    """Malformed lines of a label file; position and reason are those of the first line."""

    def __init__(self, lines: Sequence[FormatError]) -> None:
        first, *others = lines
        more = f"; {counted(len(others), 'more malformed line')}" if others else ""
        super().__init__(first.reason + more, first.path, first.line)
        self.lines = tuple(lines)


@dataclass(frozen=True, eq=False)
class LabelLine:
    """Line of a label file: a box, a box with a confidence, or a polygon."""

    path: Path
    line: int  # from 1
    label: str  # class as written
    corners: np.ndarray  # two opposite corners (2, 2) of a box or the vertices (n, 2) of a polygon, px
    confidence: float | None  # None without a sixth field
    is_polygon: bool
    fields: int

    @property
    def box(self) -> np.ndarray:
        """(4,) box as x0, y0, x1, y1 in pixels."""
        return box_around_points(self.corners) if self.is_polygon else self.corners.ravel()

    @property
    def number(self) -> int:
        """Class number."""
        if not is_whole(self.label):
            raise self.error(f"class {self.label}, expected an integer")
        return int(self.label)

    def class_in(self, names: tuple[str, ...]) -> int:
        """Return the class number, which must be an index in `names`."""
        if not is_whole(self.label) or int(self.label) >= len(names):
            raise self.error(f"class {self.label}, expected 0 to {len(names) - 1} ({', '.join(names)})")
        return int(self.label)

    def error(self, reason: str) -> FormatError:
        return FormatError(reason, self.path, self.line)


@reader("label file")
def fields_of(path: str | Path) -> list[tuple[int, list[str]]]:
    """Return number and fields of every line that is not empty."""
    lines = lines_of(Path(path).read_bytes())
    return [(number, line.split()) for number, line in enumerate(lines, 1) if line.strip()]


def read_shapes(path: str | Path, size: tuple[int, int]) -> list[LabelLine]:
    """Read every line of a label file; all other readers of label files call this function.

    A line is `class x y width height` (a box), a box with a confidence of 0 to 1 (a detection), or a class and x and y
    of at least three points (a polygon). Seven fields with an integer at the end could be a triangle or a tracked
    detection, `class x y width height confidence id`. They are accepted as a triangle only if the file also has a
    larger polygon. `size` is the width and height of the photo, px. Raises `MalformedLinesError`.
    """
    return _convert_lines(path, size, lambda shape: shape)


def _convert_lines(path: str | Path, size: tuple[int, int], convert: Callable[[LabelLine], Line]) -> list[Line]:
    """Return every line of a label file converted by a function; raise a `MalformedLinesError` with all errors."""
    lines = fields_of(path)
    outlined = any(len(fields) > 7 for _, fields in lines)
    converted, errors = [], []
    for number, fields in lines:
        try:
            corners, confidence = _corners(fields, size, outlined)
            shape = LabelLine(Path(path), number, fields[0], corners, confidence, len(fields) > 6, len(fields))
            converted.append(convert(shape))
        except FormatError as error:
            errors.append(error)
        except ValueError as error:
            errors.append(FormatError(str(error), path, number))
    if errors:
        raise MalformedLinesError(errors)
    return converted


def _corners(fields: list[str], size: tuple[int, int], outlined: bool) -> tuple[np.ndarray, float | None]:
    """Return the corners (n, 2) in pixels and the confidence of a line; raise a ValueError for an invalid line."""
    count = len(fields)
    if count < 5 or (count > 6 and count % 2 == 0):
        commas = ", with commas instead of spaces" if any("," in field for field in fields) else ""
        raise ValueError(
            f"{count} fields{commas}, expected a box of 5 (class x y width height), a detection of 6 (confidence last) "
            "or a polygon (class and x y of each point)"
        )
    values = np.array([_value(field) for field in fields[1:]])
    if not np.isfinite(values).all():
        raise ValueError("a value is not finite")
    if count > 6:
        whole = [field for field in fields[5:] if count == 7 and is_whole(field) and not outlined]
        if whole:
            raise ValueError(
                f"7 fields with the integer {whole[0]}: a track id? Expected class x y width height confidence, or "
                "a triangle with a decimal point in every coordinate"
            )
        if (np.abs(values - 0.5) > _MAX_OFFSET).any():
            hint = ": class x y width height confidence and a track id?" if count == 7 else ""
            raise ValueError(f"polygon far outside the photo{hint}")
        return values.reshape(-1, 2) * np.array(size, float), None
    if count == 6 and not 0 <= values[4] <= 1:
        raise ValueError(f"sixth field {fields[5]}, expected a confidence from 0 to 1: a track id?")
    (width, height), (x, y, w, h) = size, values[:4].tolist()
    inside = abs(x - 0.5) <= 0.5 + 1e-3 and abs(y - 0.5) <= 0.5 + 1e-3
    if not inside or not 0 < w * width <= width + 1 or not 0 < h * height <= height + 1:
        pixels = ", in pixels? Expected shares of the photo" if min(x, y, w, h) > 1 else ""
        raise ValueError(f"box outside the photo or without area{pixels}")
    x, y, half_width, half_height = x * width, y * height, w * width / 2, h * height / 2
    corners = np.array([[x - half_width, y - half_height], [x + half_width, y + half_height]])
    return corners, float(values[4]) if count == 6 else None


def _value(field: str) -> float:
    try:
        if "_" in field or not field.isascii():  # Python accepts `1_000` and digits of other scripts
            raise ValueError
        return float(field)
    except ValueError as error:
        raise ValueError(not_a_number(field)) from error


def _arrays(boxes: Iterable[tuple[int, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    boxes = list(boxes)
    return np.array([number for number, _ in boxes], int), np.array([box for _, box in boxes], float).reshape(-1, 4)


def read_boxes(
    path: str | Path,
    size: tuple[int, int],
    names: tuple[str, ...] = BOX_CLASSES,
    detections: bool = False,
    polygons: bool = False,
) -> tuple[np.ndarray, np.ndarray]:
    """Read class numbers (n,), indices in `BOX_CLASSES`, and boxes (n, 4) as x0, y0, x1, y1 in pixels.

    `names` are the names of the class numbers in the file. `detections` accepts a confidence as sixth field; `polygons`
    accepts polygons and returns the boxes around them.
    """

    def convert(shape: LabelLine) -> tuple[int, np.ndarray]:
        if (shape.fields == 6 and not detections) or (shape.is_polygon and not polygons):
            sixth = " (the sixth is the confidence of a detection)" if shape.fields == 6 else ""
            raise shape.error(f"{shape.fields} fields{sixth}, expected 5: class x y width height")
        return _box_class(shape, names), shape.box

    return _arrays(_convert_lines(path, size, convert))


def _box_class(shape: LabelLine, names: tuple[str, ...]) -> int:
    name = names[shape.class_in(names)]
    if plain(name) not in BOX_CLASSES:
        raise shape.error(f"class {shape.label} is {name!r}, expected {' or '.join(BOX_CLASSES)}")
    return BOX_CLASSES.index(plain(name))


def write_boxes(
    path: str | Path,
    classes: np.ndarray,
    boxes: np.ndarray,
    size: tuple[int, int],
    confidences: np.ndarray | None = None,
) -> None:
    """Write boxes (n, 4) in pixels with 6 decimals, as in the release. Without boxes, the file is empty.

    Confidences (n,) are written as sixth field, which `read_detections` reads. `size` is that of `read_boxes`.
    """
    boxes, photo = np.asarray(boxes, float).reshape(-1, 4), np.array(size, float)
    centre = (boxes[:, :2] + boxes[:, 2:]) / 2 / photo
    extent = (boxes[:, 2:] - boxes[:, :2]) / photo
    ends = [""] * len(boxes) if confidences is None else [f" {confidence:.4f}" for confidence in confidences]
    lines = [
        f"{c} {x:.6f} {y:.6f} {w:.6f} {h:.6f}{end}\n"
        for c, (x, y), (w, h), end in zip(np.asarray(classes, int), centre, extent, ends, strict=True)
    ]
    write_text(path, "".join(lines))


def read_detections(path: str | Path, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Read class numbers (n,) of any classes, boxes (n, 4) in pixels of a photo, and confidences (n,).

    The confidence is NaN if a line has no sixth field.
    """

    def convert(shape: LabelLine) -> tuple[int, np.ndarray, float]:
        if shape.is_polygon:
            raise shape.error(f"{shape.fields} fields, expected class x y width height [confidence]")
        return shape.number, shape.box, np.nan if shape.confidence is None else shape.confidence

    lines = _convert_lines(path, size, convert)
    return *_arrays((number, box) for number, box, _ in lines), np.array([line[2] for line in lines], float)


def read_polygons(
    path: str | Path, size: tuple[int, int], names: tuple[str, ...] = POLYGON_CLASSES
) -> list[tuple[int, np.ndarray]]:
    """Read the class, an index in `names`, and the vertices (n, 2) in pixels of each polygon, in file order."""

    def convert(shape: LabelLine) -> tuple[int, np.ndarray]:
        if not shape.is_polygon:
            raise shape.error(f"{shape.fields} fields (a box), expected a polygon: a class and at least 3 points")
        return shape.class_in(names), shape.corners

    return _convert_lines(path, size, convert)


def read_boxes_or_polygons(
    path: str | Path, size: tuple[int, int], names: tuple[str, ...] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Read boxes as `read_boxes` does, or the boxes around the polygons of rocks and shadows, clipped to the photo.

    `names` are the names of the class numbers in the file; None: `BOX_CLASSES` for boxes, `POLYGON_CLASSES` for
    polygons. All lines must have the form of the first line.
    """
    if not has_polygons(path):
        return read_boxes(path, size, names or BOX_CLASSES)
    names = names or POLYGON_CLASSES
    photo = np.array(size, float)
    rings = [(plain(names[number]), ring) for number, ring in read_polygons(path, size, names)]
    annotated = [(BOX_CLASSES.index(kind), np.clip(ring, 0, photo)) for kind, ring in rings if kind in BOX_CLASSES]
    boxes = np.array([box_around_points(ring) for _, ring in annotated]).reshape(-1, 4)
    has_area = (boxes[:, 2:] > boxes[:, :2]).all(axis=1)
    return np.array([number for number, _ in annotated], int)[has_area], boxes[has_area]


def has_polygons(path: str | Path) -> bool:
    """Return whether the first line of a label file is a polygon; a box has 5 fields, or 6 with a confidence."""
    lines = fields_of(path)
    return bool(lines) and len(lines[0][1]) > 6


def write_polygons(path: str | Path, polygons: list[tuple[int, np.ndarray]], size: tuple[int, int]) -> None:
    """Write polygons (class, vertices (n, 2) in pixels) with 6 decimals."""
    lines, photo = [], np.array(size, float)
    for number, vertices in polygons:
        coordinates = " ".join(f"{value:.6f}" for value in (np.asarray(vertices, float) / photo).ravel())
        lines.append(f"{number} {coordinates}\n")
    write_text(path, "".join(lines))


def read_rock_boxes(seeds: Path, terrain: Terrain, size: tuple[int, int]) -> dict[str, list[np.ndarray]]:
    """Read the rock boxes (n, 4), pixels, of the seeds of a terrain in left photos: an array per file, by position."""
    boxes: dict[str, list[np.ndarray]] = {}
    for path in sorted(Path(seeds).glob("*.txt")):
        with with_path(path):
            key = PhotoKey.parse(path.stem)
        if key.terrain == terrain and key.camera == "L":
            classes, annotated = read_boxes(path, size)
            boxes.setdefault(key.position, []).append(annotated[classes == BOX_CLASSES.index(ROCK)])
    return boxes
