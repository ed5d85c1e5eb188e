"""COCO files of rocks and shadows, written by polarsim or exported from annotation tools.

Masks are run-length encoded; a shadow refers to the annotation of the rock that casts it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from polarsim.errors import FormatError, LabelError, with_part
from polarsim.formats.coco_annotations import (
    CATEGORIES,
    TWO_CORNERS,
    Annotation,
    CocoPart,
    Row,
    StoredAnnotation,
    annotation_of,
    fields_of,
    form_of,
    segmentation_of,
)
from polarsim.formats.files import relative_to, writing
from polarsim.formats.readers import reader
from polarsim.formats.tables import key_columns
from polarsim.formats.yaml_files import describe_error
from polarsim.photo import BOX_CLASSES, NO_ROCK, ROCK, SHADOW, PhotoKey
from polarsim.site import DEFAULT, Site

PER_PHOTO = 10_000  # annotation ids per photo
_MIN_CORNER_CHECK_BOXES = 3  # minimum number of boxes for the check whether all boxes are stored as two corners


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
    coded = cache(lambda mask: segmentation_of(mask, simplify_px))
    columns = cache(lambda annotation: fields_of(annotation, coded))  # exposures share annotations
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


class _Image(CocoPart):
    id: int
    file_name: str
    key: str | None = None  # photo key, for files with another name
    width: int | None = None
    height: int | None = None


class _Category(CocoPart):
    id: int
    name: str


class _File(CocoPart):
    images: list[_Image]
    categories: list[_Category]
    annotations: list[StoredAnnotation]


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
            annotation = annotation_of(row, names, sizes[row.image_id], kinds)
        pictures[row.image_id].append(Row(where, form_of(row), annotation))
    _check_corners(content.annotations, sizes)
    return [(image.key or image.file_name, sizes[number], pictures[number]) for number, image in images.items()]


def _check_corners(annotations: Sequence[StoredAnnotation], sizes: Mapping[int, tuple[int, int]]) -> None:
    """Raise an error if all boxes of a file are two corners instead of a corner and a size."""
    boxed = [row for row in annotations if row.bbox]
    boxes = np.array([row.bbox for row in boxed]).reshape(-1, 4)
    picture = np.array([sizes[row.image_id] for row in boxed]).reshape(-1, 2)
    if (
        len(boxed) >= _MIN_CORNER_CHECK_BOXES
        and (boxes[:, 2:] > boxes[:, :2]).all()
        and (boxes[:, 2:] > picture / 2).any()
    ):
        raise FormatError(f"annotation {boxed[0].id}: bbox {boxed[0].bbox}: {TWO_CORNERS}")


def _once(what: str, pairs: Iterable[tuple[int, Any]]) -> dict[int, Any]:
    value_of_id: dict[int, Any] = {}
    for number, value in pairs:
        if number in value_of_id:
            raise FormatError(f"{what} id {number} is used twice")
        value_of_id[number] = value
    return value_of_id
