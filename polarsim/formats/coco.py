"""COCO files of rocks and shadows, written by polarsim or exported from annotation tools.

Masks are run-length encoded; a shadow refers to the annotation of the rock that casts it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from polarsim.errors import FormatError, LabelError, with_part
from polarsim.formats import rle
from polarsim.formats.files import relative_to, writing
from polarsim.formats.readers import reader
from polarsim.formats.rle import Rle
from polarsim.formats.tables import key_columns
from polarsim.formats.yaml_files import describe_error
from polarsim.geometry.boxes import area, box_of_mask, rotated_box
from polarsim.geometry.polygons import outlines, rasterised
from polarsim.photo import BOX_CLASSES, NO_ROCK, ROCK, SHADOW, PhotoKey
from polarsim.site import DEFAULT, Site

CATEGORIES = {ROCK: 1, SHADOW: 2}  # ids start at 1 because CVAT does not accept the id 0
PER_PHOTO = 10_000  # annotation ids per photo
MAX_POLYGON_COORDINATE_PX = 1e5  # maximum absolute coordinate of a polygon
MAX_OVERHANG = 0.1  # maximum overhang of a box over the image border, as a share of the image side
_MIN_CORNER_CHECK_BOXES = 3  # minimum number of boxes for the check whether all boxes are stored as two corners


@dataclass(frozen=True)
class Amodal:
    """Amodal mask of an object, including occluded pixels, and the bounding box (4,) of the mask."""

    mask: Rle
    box: np.ndarray


@dataclass(frozen=True, eq=False)
class Annotation:
    """Rock or shadow of a photo: bounding box (4,) of the label and mask of the visible pixels."""

    kind: str
    rock: int
    box: np.ndarray
    mask: Rle | None = None  # None: only the box is known
    source: str = ""
    confidence: float = 1.0
    amodal: Amodal | None = None  # None: not known

    @property
    def visible_share(self) -> float:
        """Visible share of the amodal mask; 1 if a mask is unknown."""
        if self.amodal is None or self.mask is None or not self.amodal.mask.area:
            return 1.0
        return self.mask.area / self.amodal.mask.area


def write_coco(
    path: str | Path,
    photos: Mapping[PhotoKey, Sequence[Annotation]],
    site: Site,
    size: tuple[int, int],
    *,
    simplify_px: float | None = None,
    pictures: Mapping[PhotoKey, Path] | None = None,
) -> None:
    """Write the annotations of photos, one per line. Photos without annotations are listed as images.

    Masks are written as compressed runs, or as polygons, largest first, if `simplify_px` is given: Label Studio's
    converter cannot read runs. `simplify_px` is the maximum distance of a dropped vertex from the polygon. The id of
    an image is `Site.image_id`, the same in every file; that of an annotation is image id * 10,000 + 1, 2, ... in the
    given order. Fields that COCO does not define are repeated in
    `attributes`, which CVAT keeps. The source is called `label_source` there, because CVAT has a field `source`.
    `size` is the width and height of the images, px. `file_name` is the path from the folder of the COCO file to the
    image of the photo in `pictures`, or KEY.png if `pictures` has no image of the photo.
    """
    rows = []
    for key in sorted(photos):
        name = relative_to(pictures[key], Path(path).parent) if pictures and key in pictures else f"{key}.png"
        image = {"id": site.image_id(key), "file_name": name, "width": size[0], "height": size[1], **key_columns(key)}
        rows.append((image, photos[key]))
    write_coco_images(path, rows, _description(site), simplify_px)


def _description(site: Site) -> str:
    of = "POLAR data set" if site.name == DEFAULT else f"site {site.name}"
    return f"Rocks and shadows of the {of}, labelled by polarsim"


def write_coco_images(
    path: str | Path,
    pictures: Sequence[tuple[Mapping[str, Any], Sequence[Annotation]]],
    description: str,
    simplify_px: float | None = None,
) -> None:
    """Write images of any name with their annotations, as `write_coco` does.

    `pictures` has the row of `images` (id, file_name, width, height, ...) and the annotations of each image.
    """
    head = {
        "info": {"description": description},
        "licenses": [],
        "categories": [{"id": number, "name": name, "supercategory": "terrain"} for name, number in CATEGORIES.items()],
    }
    coded = cache(lambda mask: _segmentation(mask, simplify_px))
    columns = cache(lambda annotation: _columns(annotation, coded))  # exposures share annotations
    encode = json.JSONEncoder(allow_nan=False).encode
    annotations = (row for image, labels in pictures for row in _annotation_rows(image["id"], labels, columns))
    with writing(path) as temporary, temporary.open("w", encoding="ascii", newline="\n") as file:
        file.write(json.dumps(head)[:-1])
        for name, rows in (("images", (image for image, _ in pictures)), ("annotations", annotations)):
            file.write(f',\n"{name}": [')
            for number, row in enumerate(rows):
                file.write((",\n" if number else "\n") + encode(row))
            file.write("\n]")
        file.write("}\n")


def _segmentation(mask: Rle | None, simplify_px: float | None) -> object:
    if mask is None:
        return []
    if simplify_px is None:
        return {"size": [mask.height, mask.width], "counts": mask.counts}
    return [ring.round(3).ravel().tolist() for ring in outlines(mask.mask(), simplify_px)]


def _annotation_rows(
    photo: int, annotations: Sequence[Annotation], columns: Callable[[Annotation], dict[str, object]]
) -> Iterator[dict[str, object]]:
    assert len(annotations) < PER_PHOTO
    numbered = list(enumerate(annotations, photo * PER_PHOTO + 1))
    rocks = [(label.rock, number) for number, label in numbered if label.kind == ROCK and label.rock != NO_ROCK]
    id_of_rock = dict(reversed(rocks))  # of the first rock with this id
    for number, annotation in numbered:
        shadow_of = {"shadow_of": id_of_rock.get(annotation.rock)} if annotation.kind == SHADOW else {}
        yield {"id": number, "image_id": photo, **columns(annotation), **shadow_of}


def _columns(annotation: Annotation, coded: Callable[[Rle | None], object]) -> dict[str, object]:
    """Return the fields that do not depend on the photo; `shadow_of` is a placeholder for the order of the fields."""
    amodal = annotation.amodal and {
        "amodal_bbox": _bbox(annotation.amodal.box),
        "amodal_segmentation": coded(annotation.amodal.mask),
        "visible_share": round(annotation.visible_share, 4),
    }
    return {
        "category_id": CATEGORIES[annotation.kind],
        "bbox": _bbox(annotation.box),
        "area": annotation.mask.area if annotation.mask else round(float(area(annotation.box)), 3),
        "segmentation": coded(annotation.mask),
        "iscrowd": 0,
        "rock": annotation.rock,
        "source": annotation.source,
        "confidence": annotation.confidence,
        **({"shadow_of": None} if annotation.kind == SHADOW else {}),
        **(amodal or {}),
        "attributes": {
            "rock": annotation.rock,
            "confidence": annotation.confidence,
            "label_source": annotation.source,
        },
    }


def _bbox(box: np.ndarray) -> list[float]:
    x0, y0, x1, y1 = (float(edge) for edge in box)
    return [round(value, 3) for value in (x0, y0, x1 - x0, y1 - y0)]


class _Part(BaseModel):
    model_config = ConfigDict(allow_inf_nan=False)


class _Image(_Part):
    id: int
    file_name: str
    key: str | None = None  # photo key, for files with another name
    width: int | None = None
    height: int | None = None


class _Category(_Part):
    id: int
    name: str


class _Runs(_Part):
    size: tuple[int, int]
    counts: str | list[Annotated[int, Field(ge=0, lt=1 << 31)]]


class _ExtraFields(_Part):
    rock: Annotated[int, Field(ge=NO_ROCK, lt=1 << 31)] | None = None
    source: str | None = None
    label_source: str | None = None  # name of `source` in `attributes`
    confidence: float | None = None

    @field_validator("rock", "confidence", "rotation", mode="before", check_fields=False)
    @classmethod
    def _empty(cls, value: object) -> object:
        return None if value == "" else value  # annotation tools write an empty text for an unset field


class _Attributes(_ExtraFields):
    rotation: float | None = None  # of the bbox about the centre, degrees, as exported by CVAT


_Segmentation = _Runs | list[list[float]] | list[float]  # runs, polygons, or the coordinates of a single polygon


class _Annotation(_ExtraFields):
    id: int | None = None
    image_id: int
    category_id: int
    bbox: list[float] = []
    area: Any = None
    iscrowd: Any = 0
    segmentation: _Segmentation | None = None
    amodal_bbox: list[float] = []
    amodal_segmentation: _Segmentation | None = None
    attributes: _Attributes | None = None

    def value_of(self, name: str, default: Any) -> Any:
        """Return the value of a field of the annotation or, if it is unset, of `attributes`."""
        values = (getattr(self, name), getattr(self.attributes, name, None))
        return next((value for value in values if value is not None), default)


class _File(_Part):
    images: list[_Image]
    categories: list[_Category]
    annotations: list[_Annotation]


@reader("COCO file", largest_mb=500)
def read_coco(
    path: str | Path, size: tuple[int, int], key_of: Callable[[str], PhotoKey]
) -> dict[PhotoKey, list[Annotation]]:
    """Read the annotations of every photo of a COCO file, see `read_coco_images`.

    All images must have the size (width, height), px. `key_of` returns the photo key of an image, from the field `key`
    or, without this field, from the file name: `Site.key_of_picture`, or `PhotoKey.parse` for files of a run.
    """
    photos: dict[PhotoKey, list[Annotation]] = {}
    for name, image_size, rows in read_coco_images(path, size, BOX_CLASSES):
        if image_size != size:
            raise FormatError(f"image {name}: {image_size[0]} x {image_size[1]} px, expected {size[0]} x {size[1]}")
        key = key_of_image(path, name, key_of)
        if key in photos:
            raise FormatError(f"two images of photo {key}")
        photos[key] = [row.annotation for row in rows]
    return photos


def key_of_image(path: str | Path, name: str, key_of: Callable[[str], PhotoKey]) -> PhotoKey:
    """Return the photo key in the name of an image that a label file states."""
    try:
        return key_of(name)
    except LabelError as error:
        raise FormatError(error.reason, path=path) from error


@dataclass(frozen=True, eq=False)
class Row:
    """Annotation of a COCO file with its name for messages and the form in which it was stored."""

    where: str
    form: str  # box, rotated box, polygon, mask or crowd region
    annotation: Annotation


@reader("COCO file", largest_mb=500)
def read_coco_images(
    path: str | Path, default_size: tuple[int, int], kinds: Sequence[str] | None = None
) -> list[tuple[str, tuple[int, int], list[Row]]]:
    """Read the name, the size (width, height) and the annotations of every image of a COCO file.

    The name is the photo key of the image if `key` is given, else `file_name`; the size of images without width and
    height is `default_size`. Annotations are in pixels of the image. Categories are identified by name and must be in
    `kinds` (None: any name). Masks are runs, compressed or not, or polygons. A missing box is computed from the mask; a
    rotated box (CVAT) is replaced by the axis-aligned box around it. The rock, source and confidence are read from the
    annotation or from `attributes` (CVAT) and may be missing.
    """
    try:
        content = _File.model_validate_json(Path(path).read_bytes())
    except ValidationError as error:
        raise FormatError(f"no COCO file, {describe_error(error, 'images, categories, annotations')}") from error
    images = _once("image", ((image.id, image) for image in content.images))
    names = _once("category", ((category.id, category.name) for category in content.categories))
    sizes = {
        number: (image.width or default_size[0], image.height or default_size[1]) for number, image in images.items()
    }
    pictures: dict[int, list[Row]] = {number: [] for number in images}
    for number, row in enumerate(content.annotations):
        where = f"annotation {number if row.id is None else row.id}"
        with with_part(where):
            if row.image_id not in images:
                raise FormatError(f"image_id {row.image_id} is not the id of an image in the file")
            annotation = _annotation(row, names, sizes[row.image_id], kinds)
        pictures[row.image_id].append(Row(where, _form(row), annotation))
    _check_corners(content.annotations, sizes)
    return [(image.key or image.file_name, sizes[number], pictures[number]) for number, image in images.items()]


def _check_corners(annotations: Sequence[_Annotation], sizes: Mapping[int, tuple[int, int]]) -> None:
    """Raise an error if all boxes of a file are two corners instead of a corner and a size."""
    boxed = [row for row in annotations if row.bbox]
    boxes = np.array([row.bbox for row in boxed]).reshape(-1, 4)
    picture = np.array([sizes[row.image_id] for row in boxed]).reshape(-1, 2)
    if (
        len(boxed) >= _MIN_CORNER_CHECK_BOXES
        and (boxes[:, 2:] > boxes[:, :2]).all()
        and (boxes[:, 2:] > picture / 2).any()
    ):
        raise FormatError(f"annotation {boxed[0].id}: bbox {boxed[0].bbox}: {_TWO_CORNERS}")


def _once(what: str, pairs: Iterable[tuple[int, Any]]) -> dict[int, Any]:
    value_of_id: dict[int, Any] = {}
    for number, value in pairs:
        if number in value_of_id:
            raise FormatError(f"{what} id {number} is used twice")
        value_of_id[number] = value
    return value_of_id


def _form(row: _Annotation) -> str:
    if row.iscrowd in (1, True):
        return "crowd region"
    if row.bbox:
        return "rotated box" if row.attributes and row.attributes.rotation else "box"
    return "mask" if isinstance(row.segmentation, _Runs) else "polygon"


def _annotation(
    row: _Annotation, names: Mapping[int, str], size: tuple[int, int], kinds: Sequence[str] | None
) -> Annotation:
    if row.category_id not in names:
        raise FormatError(f"category_id {row.category_id} is not the id of a category in the file")
    kind = names[row.category_id]
    if kinds is not None:
        kind = kind.strip().lower()
        if kind not in kinds:
            raise FormatError(f"category {names[row.category_id]!r}, expected {' or '.join(kinds)}")
    mask = _mask(row.segmentation, size)
    rock, confidence = row.value_of("rock", NO_ROCK), row.value_of("confidence", 1.0)
    source = row.value_of("source", row.value_of("label_source", ""))
    amodal_mask = _mask(row.amodal_segmentation, size)
    amodal = Amodal(amodal_mask, _box(row.amodal_bbox, amodal_mask, size)) if amodal_mask else None
    box = _box(row.bbox, mask, size)
    if row.bbox:
        _check_plausible(row, mask, size)
        rotation = (row.attributes.rotation if row.attributes else None) or 0.0
        if rotation:
            box = rotated_box(box, rotation) if mask is None else _box([], mask, size)
    return Annotation(kind, rock, box, mask, source, confidence, amodal)


_TWO_CORNERS = "expected x, y, width and height: are these x0, y0, x1, y1?"


def _check_plausible(row: _Annotation, mask: Rle | None, size: tuple[int, int]) -> None:
    """Raise an error for a bbox in shares of the image size, far over the image border, or of two corners."""
    x, y, width, height = row.bbox
    if max(row.bbox) <= 1:
        raise FormatError(f"bbox {row.bbox}, expected pixels: are these shares of the picture?")
    border = np.array([x + width, y + height]) - size
    if (border > MAX_OVERHANG * np.array(size)).any() or min(x / size[0], y / size[1]) < -MAX_OVERHANG:
        raise FormatError(f"bbox {row.bbox} reaches far over the border of {size[0]} x {size[1]} px; {_TWO_CORNERS}")
    if width <= x or height <= y:
        return
    if mask is not None:
        covered = box_of_mask(mask.mask())
        corners, sized = np.array(row.bbox), np.array([x, y, x + width, y + height])
        if covered is not None and np.abs(corners - covered).max() < 2 < np.abs(sized - covered).max():
            raise FormatError(f"bbox {row.bbox} contradicts the mask from {covered.tolist()}; {_TWO_CORNERS}")
    elif isinstance(row.area, (int, float)) and row.area > 0:
        of_corners, of_size = (abs(row.area / value - 1) for value in ((width - x) * (height - y), width * height))
        if of_corners < 0.01 < of_size:
            raise FormatError(f"bbox {row.bbox} contradicts the area {row.area}; {_TWO_CORNERS}")


def _mask(segmentation: _Segmentation | None, size: tuple[int, int]) -> Rle | None:
    if isinstance(segmentation, _Runs):
        if segmentation.size != size[::-1]:
            raise FormatError(f"size {list(segmentation.size)} of a mask, expected {list(size[::-1])}")
        counts = segmentation.counts
        return rle.from_text(counts, size) if isinstance(counts, str) else rle.from_runs(counts, size)
    listed = segmentation or []
    rings = [np.array(ring) for ring in ([listed] if listed and not isinstance(listed[0], list) else listed) if ring]
    if not rings:
        return None
    covered = np.zeros(size[::-1], bool)
    for ring in rings:
        if len(ring) < 6 or len(ring) % 2:
            raise FormatError(f"polygon of {len(ring)} numbers, expected x and y of at least 3 points")
        if np.abs(ring).max() > MAX_POLYGON_COORDINATE_PX:
            raise FormatError("polygon far outside the photo")
        covered |= rasterised(ring.reshape(-1, 2), size[::-1])
    return rle.encode_rle(covered, size=size)


def _box(bbox: list[float], mask: Rle | None, size: tuple[int, int]) -> np.ndarray:
    """Return the bounding box (4,) as x0, y0, x1, y1."""
    if bbox:
        if len(bbox) != 4 or min(bbox[2:]) <= 0:
            raise FormatError(f"bbox {bbox}, expected x, y, width and height, both above 0")
        box = np.array([bbox[0], bbox[1], bbox[0] + bbox[2], bbox[1] + bbox[3]])
        if (box[:2] >= size).any() or (box[2:] <= 0).any():
            raise FormatError(f"bbox {bbox} outside the photo")
        return box
    covered = box_of_mask(mask.mask()) if mask else None
    if covered is None:
        raise FormatError("neither a bbox nor a mask")
    return covered
