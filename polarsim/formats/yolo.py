"""YOLO label files: boxes `class x y w h` and polygons `class x1 y1 x2 y2 ...`, relative to the photo's size."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.errors import FormatError, PolarsimError, about
from polarsim.formats.files import read_json, text_of, write_text
from polarsim.formats.readers import reader, reading
from polarsim.formats.text_fields import fields_of, numbers
from polarsim.formats.yaml_files import read_yaml
from polarsim.geometry.boxes import around
from polarsim.photo import BOX_CLASSES, HEIGHT, POLYGON_CLASSES, ROCK, WIDTH, PhotoKey

CLASS_FILE = "classes.txt"  # names of the class numbers of the label files in the same folder, one per line
NOTES_FILE = "notes.json"  # class list of Label Studio's YOLO export
FOLDERS_UP = 2  # Ultralytics stores data.yaml two folders above the label files
_SIZE = np.array([WIDTH, HEIGHT], float)
_FARTHEST = 0.6  # widths or heights of the photo from its centre: no tool draws a tenth of a photo outside of it
_MOST_CLASSES = 10_000


@dataclass(frozen=True, eq=False)
class Shape:
    """One line of a label file: a box, a box with a confidence, or a polygon."""

    line: int  # from 1
    label: str  # class as written
    corners: np.ndarray  # two opposite corners (2, 2) of a box or the vertices (n, 2) of a polygon, px
    confidence: float | None  # None without a sixth field
    is_polygon: bool
    fields: int

    @property
    def box(self) -> np.ndarray:
        """(4,) box as x0, y0, x1, y1 in pixels."""
        return around(self.corners) if self.is_polygon else self.corners.ravel()


@reader("label file", largest_mb=100)
def read_shapes(path: str | Path, size: tuple[int, int] | None = None) -> list[Shape]:
    """Read every line of a label file; all other readers of label files use this grammar.

    A line is `class x y width height` (a box), the same with a confidence of 0 to 1 (a detection), or a class and x and
    y of at least three points (a polygon). A triangle with a whole number as its third point could also be a tracked
    detection, `class x y width height confidence id`: it needs a larger polygon in the same file.
    `size` is the width and height of the photo, the rig's by default.

    Raises
    ------
    FormatError
        A line is none of these, or its values cannot be: file, line number and reason.
    """
    lines = fields_of(path, "label file")
    outlined = any(len(fields) > 7 for _, fields in lines)
    return [_shape(path, number, fields, size or (WIDTH, HEIGHT), outlined) for number, fields in lines]


def _shape(path: str | Path, number: int, fields: list[str], size: tuple[int, int], outlined: bool) -> Shape:
    count = len(fields)
    if count < 5 or (count > 6 and count % 2 == 0):
        commas = ", with commas instead of spaces" if any("," in field for field in fields) else ""
        raise FormatError(
            f"{count} fields{commas}, expected a box of 5 (class x y width height), a detection of 6 (confidence last) "
            "or a polygon (class and x y of each point)",
            path=path,
            line=number,
        )
    values = numbers(path, number, fields[1:])
    if count > 6:
        whole = [field for field in fields[5:] if count == 7 and _is_whole(field) and not outlined]
        if whole:
            raise FormatError(
                f"7 fields with the whole number {whole[0]}: a track id? Expected class x y width height confidence or "
                "a triangle, whose coordinates have a decimal point",
                path=path,
                line=number,
            )
        if (np.abs(values - 0.5) > _FARTHEST).any():
            hint = ": class x y width height confidence and a track id?" if count == 7 else ""
            raise FormatError(f"polygon far outside the photo{hint}", path=path, line=number)
        return Shape(number, fields[0], values.reshape(-1, 2) * np.array(size, float), None, True, count)
    if count == 6 and not 0 <= values[4] <= 1:
        raise FormatError(f"sixth field {fields[5]}, no confidence from 0 to 1: a track id?", path=path, line=number)
    (width, height), (x, y, w, h) = size, values[:4].tolist()
    inside = abs(x - 0.5) <= 0.5 + 1e-3 and abs(y - 0.5) <= 0.5 + 1e-3
    if not inside or not 0 < w * width <= width + 1 or not 0 < h * height <= height + 1:
        pixels = ", in pixels? Expected shares of the photo" if min(x, y, w, h) > 1 else ""
        raise FormatError(f"box outside the photo or without area{pixels}", path=path, line=number)
    x, y, half_width, half_height = x * width, y * height, w * width / 2, h * height / 2
    corners = np.array([[x - half_width, y - half_height], [x + half_width, y + half_height]])
    return Shape(number, fields[0], corners, float(values[4]) if count == 6 else None, False, count)


def _is_whole(text: str) -> bool:
    """Return whether a text is a number of ASCII digits; `int` also accepts those of other scripts."""
    return text.isascii() and text.isdigit()


def _arrays(classes: Iterable[int], boxes: Iterable[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    return np.array(list(classes), int), np.array(list(boxes), float).reshape(-1, 4)


@reader("label file", largest_mb=100)
def read_boxes(
    path: str | Path,
    size: tuple[int, int] | None = None,
    names: tuple[str, ...] = BOX_CLASSES,
    detections: bool = False,
    polygons: bool = False,
) -> tuple[np.ndarray, np.ndarray]:
    """Class numbers (n,) and boxes (n, 4) as x0, y0, x1, y1 in pixels; `size` (width, height) is the rig's by default.

    Parameters
    ----------
    names
        What the file's class numbers mean; the numbers that are returned are indices in `BOX_CLASSES`.
    detections
        Accept a confidence as sixth field.
    polygons
        Accept polygons, as the boxes around them.

    Raises
    ------
    FormatError
        A line that is no box of a rock or shadow inside the photo: file, line number and reason.
    """
    classes, boxes = [], []
    for shape in read_shapes(path, size):
        if (shape.fields == 6 and not detections) or (shape.is_polygon and not polygons):
            sixth = " (the sixth is a confidence, of a detection)" if shape.fields == 6 else ""
            raise FormatError(
                f"{shape.fields} fields{sixth}, a YOLO box has 5: class x y width height", path=path, line=shape.line
            )
        classes.append(_box_class(path, shape, names))
        boxes.append(shape.box)
    return _arrays(classes, boxes)


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

    Boxes are in pixels of a photo of the rig. A confidence is NaN where a line has no sixth field.

    Raises
    ------
    FormatError
        A line that is no box inside the photo: file, line number and reason.
    """
    shapes = read_shapes(path)
    for shape in shapes:
        if shape.is_polygon:
            raise FormatError(
                f"{shape.fields} fields, expected class x y width height [confidence]", path=path, line=shape.line
            )
    classes, boxes = _arrays((class_number(path, shape) for shape in shapes), (shape.box for shape in shapes))
    return classes, boxes, np.array([np.nan if one.confidence is None else one.confidence for one in shapes], float)


def class_number(path: str | Path, shape: Shape) -> int:
    """Return the class of a line of a label file.

    Raises
    ------
    FormatError
        The class is no whole number.
    """
    if not _is_whole(shape.label):
        raise FormatError(f"class {shape.label}, expected a whole number", path=path, line=shape.line)
    return int(shape.label)


@dataclass(frozen=True)
class ClassList:
    """Names of class numbers and the file that states them."""

    names: tuple[str, ...]  # by class number; "" for a number without a name
    path: Path | None  # None: no list was found, and `BOX_CLASSES` is assumed

    def __str__(self) -> str:
        return ", ".join(f"{number} {name}" for number, name in enumerate(self.names) if name)


@reader("class list")
def find_classes(folder: Path, top: Path | None = None) -> ClassList:
    """Find the names of the class numbers of the label files in a folder.

    Lists are `classes.txt`, `*.names` (Darknet, CVAT), `names` of a YAML file (Ultralytics, Roboflow) and `notes.json`
    (Label Studio). The folder comes first, then the folders above it as far as `top`, any other folder below `top`, and
    at last the nearest of `FOLDERS_UP` folders above. Without a list, `BOX_CLASSES` is assumed.

    Parameters
    ----------
    top
        Folder of the whole data set: lists inside it must agree. None: lists of the folder itself come first.

    Raises
    ------
    FormatError
        A list is broken, or two lists give one number different names.
    """
    inside = [folder, *(above for above in folder.parents if top and (above == top or top in above.parents))]
    found = [one for above in inside for one in _lists_in(above)]
    if top and not found:
        below = sorted({path.parent for path in top.rglob("*") if is_class_list(path)})
        found = [one for other in below for one in _lists_in(other)]
    for above in list((top or folder).absolute().parents)[:FOLDERS_UP]:
        found = found or list(_lists_in(above, lenient=True))
    if not found:
        return ClassList(BOX_CLASSES, None)
    longest = max(found, key=lambda one: len(one.names))
    for other in found:
        pairs = zip(map(_plain, other.names), map(_plain, longest.names), strict=False)
        if any(one and two and one != two for one, two in pairs):
            raise FormatError(f"classes {other}, but {longest.path}: {longest}; keep one list", path=other.path)
    return longest


@reader("class list")
def class_names(folder: Path) -> tuple[str, ...]:
    """Return what class numbers mean in a folder, as `find_classes` does; the list in the folder itself comes first.

    Raises
    ------
    FormatError
        The list is no text, is empty, has a name twice, or contradicts another one.
    """
    return find_classes(folder).names


def _plain(name: str) -> str:
    return name.strip().lower()


def is_class_list(path: Path) -> bool:
    return path.name in (CLASS_FILE, NOTES_FILE) or path.suffix.lower() in (".names", ".yaml", ".yml")


def _lists_in(folder: Path, lenient: bool = False) -> Iterator[ClassList]:
    """Class lists in a folder; `lenient` skips YAML files that nobody can read, unless they describe a data set."""
    for path in sorted(path for path in folder.glob("*") if is_class_list(path) and path.is_file()):
        try:
            names = _names_in(path)
        except PolarsimError:
            if lenient and path.suffix in (".yaml", ".yml") and path.stem != "data":
                continue
            raise
        if names is not None:
            twice = [name for name in names if name and names.count(name) > 1]
            if twice:
                raise FormatError(f"class {twice[0]!r} is there twice", path=path)
            yield ClassList(names, path)


def _names_in(path: Path) -> tuple[str, ...] | None:
    """Names by class number; None for a file of another purpose."""
    if path.suffix.lower() in (".yaml", ".yml"):
        content = read_yaml(path)
        if not isinstance(content, dict) or "names" not in content:
            return None
        if "kpt_shape" in content:
            raise FormatError("kpt_shape: lines with keypoints are not read; export boxes or polygons", path=path)
        return _numbered(path, content["names"])
    if path.name == NOTES_FILE:
        content = read_json(path)
        stated = content.get("categories") if isinstance(content, dict) else None
        if not isinstance(stated, list):
            return None
        return _numbered(path, {one.get("id"): one.get("name") for one in stated if isinstance(one, dict)})
    with reading("class list", path):
        names = tuple(line.strip() for line in text_of(path).rstrip().split("\n"))
    if not any(names):
        raise FormatError(f"no class, expected a name per line, such as {' and '.join(BOX_CLASSES)}", path=path)
    return names


def _numbered(path: Path, stated: Any) -> tuple[str, ...]:
    """Names of a list, or of a dictionary from numbers to names."""
    pairs = dict(enumerate(stated)) if isinstance(stated, list) else stated
    if not isinstance(pairs, dict) or not pairs:
        raise FormatError("names: expected a list of class names, or number: name", path=path)
    names = {}
    for number, name in pairs.items():
        if not _is_whole(str(number)) or int(number) >= _MOST_CLASSES or not isinstance(name, (str, int)):
            raise FormatError(f"names: {number!r}: {name!r}, expected number: name", path=path)
        names[int(number)] = str(name)
    return tuple(names.get(number, "") for number in range(max(names) + 1))


@reader("label file", largest_mb=100)
def read_polygons(path: str | Path, names: tuple[str, ...] = POLYGON_CLASSES) -> list[tuple[int, np.ndarray]]:
    """(class, vertices (n, 2) in pixels) of each polygon, in file order.

    Raises
    ------
    FormatError
        A line that is no polygon of a class in `names`: file, line number and reason.
    """
    polygons = []
    for shape in read_shapes(path):
        if not shape.is_polygon:
            raise FormatError(
                f"{shape.fields} fields, a box: a polygon has a class and at least 3 points", path=path, line=shape.line
            )
        polygons.append((_class(path, shape, names), shape.corners))
    return polygons


@reader("label file", largest_mb=100)
def read_boxes_or_polygons(path: str | Path, names: tuple[str, ...] | None = None) -> tuple[np.ndarray, np.ndarray]:
    """As `read_boxes`; of a file of polygons the boxes around its rocks and shadows, cut at the photo's border.

    Parameters
    ----------
    names
        What the file's class numbers mean; None: `BOX_CLASSES` of boxes, `POLYGON_CLASSES` of polygons.

    Raises
    ------
    FormatError
        A line that is neither like the first one: file, line number and reason.
    """
    if not has_polygons(path):
        return read_boxes(path, names=names or BOX_CLASSES)
    own = names or POLYGON_CLASSES
    found = [(_plain(own[number]), ring) for number, ring in read_polygons(path, own)]
    annotated = [(BOX_CLASSES.index(kind), np.clip(ring, 0, _SIZE)) for kind, ring in found if kind in BOX_CLASSES]
    boxes = np.array([[*ring.min(axis=0), *ring.max(axis=0)] for _, ring in annotated]).reshape(-1, 4)
    has_area = (boxes[:, 2:] > boxes[:, :2]).all(axis=1)
    return np.array([number for number, _ in annotated], int)[has_area], boxes[has_area]


@reader("label file", largest_mb=100)
def has_polygons(path: str | Path) -> bool:
    """Return whether the first line of a label file is a polygon; a box has 5 fields, or 6 with a confidence."""
    lines = fields_of(path, "label file")
    return bool(lines) and len(lines[0][1]) > 6


def write_polygons(path: str | Path, polygons: list[tuple[int, np.ndarray]]) -> None:
    """(class, vertices (n, 2) in pixels); the vertices get 6 decimals."""
    lines = []
    for number, vertices in polygons:
        coordinates = " ".join(f"{value:.6f}" for value in (np.asarray(vertices, float) / _SIZE).ravel())
        lines.append(f"{number} {coordinates}\n")
    write_text(path, "".join(lines))


def _box_class(path: str | Path, shape: Shape, names: tuple[str, ...]) -> int:
    name = names[_class(path, shape, names)]
    if _plain(name) not in BOX_CLASSES:
        raise FormatError(
            f"class {shape.label} is {name!r}, expected {' or '.join(BOX_CLASSES)}", path=path, line=shape.line
        )
    return BOX_CLASSES.index(_plain(name))


def _class(path: str | Path, shape: Shape, names: tuple[str, ...]) -> int:
    if not _is_whole(shape.label) or int(shape.label) >= len(names):
        raise FormatError(
            f"class {shape.label}, expected 0 to {len(names) - 1} ({', '.join(names)})", path=path, line=shape.line
        )
    return int(shape.label)


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
