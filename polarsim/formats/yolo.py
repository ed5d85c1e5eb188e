"""YOLO label files: boxes `class x y w h` and polygons `class x1 y1 x2 y2 ...`, relative to the photo's size."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from polarsim.errors import FormatError, about
from polarsim.formats.files import write_text
from polarsim.formats.readers import reader, reading
from polarsim.formats.text_fields import fields_of, numbers
from polarsim.photo import BOX_CLASSES, HEIGHT, POLYGON_CLASSES, ROCK, WIDTH, PhotoKey

CLASS_FILE = "classes.txt"  # stands beside label files and is none: the names of their class numbers, one a line
_SIZE = np.array([WIDTH, HEIGHT], float)
_FARTHEST = 1.5  # widths or heights of the photo from its middle: a lost decimal point leads farther


@reader("label file", largest_mb=100)
def read_boxes(
    path: str | Path, size: tuple[int, int] | None = None, names: tuple[str, ...] = BOX_CLASSES
) -> tuple[np.ndarray, np.ndarray]:
    """Class numbers (n,) and boxes (n, 4) as x0, y0, x1, y1 in pixels; `size` (width, height) is the rig's by default.

    Parameters
    ----------
    names
        What the file's class numbers mean; the numbers that are returned are indices in `BOX_CLASSES`.

    Raises
    ------
    FormatError
        A line that is no box of a rock or shadow inside the photo: file, line number and reason.
    """
    classes, boxes, photo = [], [], _SIZE if size is None else np.array(size, float)
    for number, fields in fields_of(path, "label file"):
        if len(fields) != 5:
            raise FormatError(f"{len(fields)} fields, a YOLO box has 5: class x y width height", path=path, line=number)
        values = numbers(path, number, fields)
        classes.append(_box_class(path, number, fields[0], names))
        centre, extent = values[1:3] * photo, values[3:5] * photo
        if (extent <= 0).any() or (extent > photo + 1).any() or (np.abs(centre / photo - 0.5) > 0.5 + 1e-3).any():
            raise FormatError("box outside the photo or without area", path=path, line=number)
        boxes.append(np.concatenate([centre - extent / 2, centre + extent / 2]))
    return np.array(classes, int), np.array(boxes, float).reshape(-1, 4)


def write_boxes(
    path: str | Path,
    classes: np.ndarray,
    boxes: np.ndarray,
    size: tuple[int, int] | None = None,
    confidences: np.ndarray | None = None,
) -> None:
    """Boxes (n, 4) in pixels, with 6 decimals as in the release; no boxes make an empty file. `size` as above.

    Confidences (n,) become a sixth field, as `read_detections` reads it.
    """
    boxes, photo = np.asarray(boxes, float).reshape(-1, 4), _SIZE if size is None else np.array(size, float)
    centre = (boxes[:, :2] + boxes[:, 2:]) / 2 / photo
    extent = (boxes[:, 2:] - boxes[:, :2]) / photo
    ends = [""] * len(boxes) if confidences is None else [f" {confidence:.4f}" for confidence in confidences]
    lines = [
        f"{c} {x:.6f} {y:.6f} {w:.6f} {h:.6f}{end}\n"
        for c, (x, y), (w, h), end in zip(np.asarray(classes, int), centre, extent, ends, strict=True)
    ]
    write_text(path, "".join(lines))


@reader("label file", largest_mb=100)
def read_detections(path: str | Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Class numbers (n,), boxes (n, 4) and confidences (n,) of anyone's boxes, of whatever classes.

    Boxes are in pixels of a photo of the rig. A line may have a sixth field, the confidence; it is NaN where there is
    none.

    Raises
    ------
    FormatError
        A line that is no box with area: file, line number and reason.
    """
    classes, boxes, confidences = [], [], []
    for number, fields in fields_of(path, "label file"):
        if len(fields) not in (5, 6):
            raise FormatError(
                f"{len(fields)} fields, expected class x y width height [confidence]", path=path, line=number
            )
        if not fields[0].isdigit():
            raise FormatError(f"class {fields[0]}, expected a whole number", path=path, line=number)
        values = numbers(path, number, fields)
        centre, extent = values[1:3] * _SIZE, values[3:5] * _SIZE
        if (extent <= 0).any():
            raise FormatError("box without area", path=path, line=number)
        classes.append(int(fields[0]))
        boxes.append(np.concatenate([centre - extent / 2, centre + extent / 2]))
        confidences.append(values[5] if len(values) == 6 else np.nan)
    return np.array(classes, int), np.array(boxes, float).reshape(-1, 4), np.array(confidences, float)


@reader("label file", largest_mb=100)
def read_boxes_of_any(path: str | Path) -> tuple[np.ndarray, np.ndarray]:
    """Class numbers (n,) and boxes (n, 4) of anyone's boxes or, around them, polygons, of whatever classes.

    Raises
    ------
    FormatError
        A line that is neither: file, line number and reason.
    """
    classes, boxes = [], []
    for number, fields in fields_of(path, "label file"):
        if len(fields) < 5 or (len(fields) > 6 and len(fields) % 2 == 0):
            raise FormatError(f"{len(fields)} fields, expected a box of 5 or a polygon", path=path, line=number)
        if not fields[0].isdigit():
            raise FormatError(f"class {fields[0]}, expected a whole number", path=path, line=number)
        values = numbers(path, number, fields)[1:]
        if len(fields) <= 6:
            centre, extent = values[:2] * _SIZE, values[2:4] * _SIZE
            corners = np.array([centre - extent / 2, centre + extent / 2])
        else:
            corners = values.reshape(-1, 2) * _SIZE
        classes.append(int(fields[0]))
        boxes.append(np.concatenate([corners.min(axis=0), corners.max(axis=0)]))
    return np.array(classes, int), np.array(boxes, float).reshape(-1, 4)


@reader("class list")
def class_names(folder: Path) -> tuple[str, ...]:
    """What class numbers mean in a folder: the lines of its `classes.txt`, rock and shadow where there is none.

    Raises
    ------
    FormatError
        The list is no text, is empty, or has a name twice.
    """
    path = folder / CLASS_FILE
    if not path.exists():
        return BOX_CLASSES
    with reading("class list", path):
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    names = tuple(line.strip() for line in "\n".join(lines).rstrip().split("\n"))
    if not any(names):
        raise FormatError(f"no class, expected a name a line, such as {' and '.join(BOX_CLASSES)}", path=path)
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise FormatError(f"class {twice[0]!r} is there twice", path=path)
    return names


@reader("label file", largest_mb=100)
def read_polygons(path: str | Path) -> list[tuple[int, np.ndarray]]:
    """(class, vertices (n, 2) in pixels) of each polygon, in file order.

    Raises
    ------
    FormatError
        A line that is no polygon of class 0 to 3: file, line number and reason.
    """
    polygons = []
    for number, fields in fields_of(path, "label file"):
        if len(fields) < 7 or len(fields) % 2 == 0:
            raise FormatError(
                f"{len(fields)} fields, a polygon has a class and at least 3 points", path=path, line=number
            )
        values = numbers(path, number, fields)
        if (np.abs(values[1:] - 0.5) > _FARTHEST).any():
            raise FormatError("polygon far outside the photo", path=path, line=number)
        polygons.append((_class(path, number, fields[0], POLYGON_CLASSES), values[1:].reshape(-1, 2) * _SIZE))
    return polygons


@reader("label file", largest_mb=100)
def read_boxes_or_polygons(path: str | Path) -> tuple[np.ndarray, np.ndarray]:
    """As `read_boxes`; of a file of polygons the boxes around its rocks and shadows, cut at the photo's border.

    Raises
    ------
    FormatError
        A line that is neither like the first one: file, line number and reason.
    """
    lines = fields_of(path, "label file")
    if not lines or len(lines[0][1]) <= 5:
        return read_boxes(path)
    found = [(POLYGON_CLASSES[number], ring) for number, ring in read_polygons(path)]
    annotated = [(BOX_CLASSES.index(kind), np.clip(ring, 0, _SIZE)) for kind, ring in found if kind in BOX_CLASSES]
    boxes = np.array([[*ring.min(axis=0), *ring.max(axis=0)] for _, ring in annotated]).reshape(-1, 4)
    has_area = (boxes[:, 2:] > boxes[:, :2]).all(axis=1)
    return np.array([number for number, _ in annotated], int)[has_area], boxes[has_area]


def write_polygons(path: str | Path, polygons: list[tuple[int, np.ndarray]]) -> None:
    """(class, vertices (n, 2) in pixels); the vertices get 6 decimals."""
    lines = []
    for number, vertices in polygons:
        coordinates = " ".join(f"{value:.6f}" for value in (np.asarray(vertices, float) / _SIZE).ravel())
        lines.append(f"{number} {coordinates}\n")
    write_text(path, "".join(lines))


def _box_class(path: str | Path, number: int, field: str, names: tuple[str, ...]) -> int:
    name = names[_class(path, number, field, names)]
    if name not in BOX_CLASSES:
        raise FormatError(f"class {field} is {name!r}, expected {' or '.join(BOX_CLASSES)}", path=path, line=number)
    return BOX_CLASSES.index(name)


def _class(path: str | Path, number: int, field: str, names: tuple[str, ...]) -> int:
    if not field.isdigit() or int(field) >= len(names):
        raise FormatError(f"class {field}, expected 0 to {len(names) - 1} ({', '.join(names)})", path=path, line=number)
    return int(field)


@reader("label file", largest_mb=100)
def read_rock_boxes(seeds: Path, terrain: int) -> dict[str, list[np.ndarray]]:
    """Rock boxes (n, 4) of a terrain's seeds in left photos by position, one array a file; pixels.

    Seeds are the label files of a run's source that its stages may read.

    Raises
    ------
    LabelError
        A file's name is no photo's, or its content no labels.
    """
    boxes: dict[str, list[np.ndarray]] = {}
    for path in sorted(Path(seeds).glob("*.txt")):
        with about(path):
            key = PhotoKey.parse(path.stem)
        if key.terrain == terrain and key.camera == "L":
            classes, annotated = read_boxes(path)
            boxes.setdefault(key.position, []).append(annotated[classes == BOX_CLASSES.index(ROCK)])
    return boxes
