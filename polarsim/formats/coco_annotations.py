"""Annotations, and the fields in which COCO files store them. `coco` reads and writes files."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_validator

from polarsim.errors import FormatError
from polarsim.formats import rle
from polarsim.formats.rle import Rle
from polarsim.geometry.boxes import area, box_of_mask, rotated_box
from polarsim.geometry.polygons import outlines, rasterised
from polarsim.photo import NO_ROCK, ROCK, SHADOW

CATEGORIES = {ROCK: 1, SHADOW: 2}  # ids start at 1 because CVAT does not accept the id 0
MAX_POLYGON_COORDINATE_PX = 1e5  # maximum absolute coordinate of a polygon
MAX_OVERHANG = 0.1  # maximum overhang of a box over the image border, as a share of the image side
TWO_CORNERS = "expected x, y, width and height: are these x0, y0, x1, y1?"


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


def segmentation_of(mask: Rle | None, simplify_px: float | None) -> object:
    """Return a mask as compressed runs, or as polygons if `simplify_px` is given, see `coco.write_coco`."""
    if mask is None:
        return []
    if simplify_px is None:
        return {"size": [mask.height, mask.width], "counts": mask.counts}
    return [ring.round(3).ravel().tolist() for ring in outlines(mask.mask(), simplify_px)]


def fields_of(annotation: Annotation, coded: Callable[[Rle | None], object]) -> dict[str, object]:
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


class CocoPart(BaseModel):
    """Part of a COCO file. Unknown fields are ignored."""

    model_config = ConfigDict(allow_inf_nan=False)


class _Runs(CocoPart):
    size: tuple[int, int]
    counts: str | list[Annotated[int, Field(ge=0, lt=1 << 31)]]


class _ExtraFields(CocoPart):
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


class StoredAnnotation(_ExtraFields):
    """Row of `annotations`."""

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


@dataclass(frozen=True, eq=False)
class Row:
    """Annotation of a COCO file with its name for messages and the form in which it was stored."""

    where: str
    form: str  # box, rotated box, polygon, mask or crowd region
    annotation: Annotation


def form_of(row: StoredAnnotation) -> str:
    """Return the form in which an annotation is stored, see `Row`."""
    if row.iscrowd in (1, True):
        return "crowd region"
    if row.bbox:
        return "rotated box" if row.attributes and row.attributes.rotation else "box"
    return "mask" if isinstance(row.segmentation, _Runs) else "polygon"


def annotation_of(
    row: StoredAnnotation, names: Mapping[int, str], size: tuple[int, int], kinds: Sequence[str] | None
) -> Annotation:
    """Return the annotation of a row, with the names of categories by id and the size of the image, px.

    `kinds`: allowed names of categories; None: any.
    """
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


def _check_plausible(row: StoredAnnotation, mask: Rle | None, size: tuple[int, int]) -> None:
    """Raise an error for a bbox in shares of the image size, far over the image border, or of two corners."""
    x, y, width, height = row.bbox
    if max(row.bbox) <= 1:
        raise FormatError(f"bbox {row.bbox}, expected pixels: are these shares of the picture?")
    border = np.array([x + width, y + height]) - size
    if (border > MAX_OVERHANG * np.array(size)).any() or min(x / size[0], y / size[1]) < -MAX_OVERHANG:
        raise FormatError(f"bbox {row.bbox} reaches far over the border of {size[0]} x {size[1]} px; {TWO_CORNERS}")
    if width <= x or height <= y:
        return
    if mask is not None:
        covered = box_of_mask(mask.mask())
        corners, sized = np.array(row.bbox), np.array([x, y, x + width, y + height])
        if covered is not None and np.abs(corners - covered).max() < 2 < np.abs(sized - covered).max():
            raise FormatError(f"bbox {row.bbox} contradicts the mask from {covered.tolist()}; {TWO_CORNERS}")
    elif isinstance(row.area, (int, float)) and row.area > 0:
        of_corners, of_size = (abs(row.area / value - 1) for value in ((width - x) * (height - y), width * height))
        if of_corners < 0.01 < of_size:
            raise FormatError(f"bbox {row.bbox} contradicts the area {row.area}; {TWO_CORNERS}")


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
