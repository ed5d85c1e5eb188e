"""What one label file shows by itself, of boxes or polygons, and polygons beside the boxes of the same photo."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from polarsim.geometry.boxes import area, around, iou, largest_iou, match
from polarsim.geometry.polygons import signed_area
from polarsim.lint.rules import Defect
from polarsim.photo import BOX_CLASSES, HEIGHT, POLYGON_CLASSES, ROCK, SHADOW, WIDTH, PhotoKey

Boxes = tuple[np.ndarray, np.ndarray]  # class numbers (n,), boxes (n, 4) in pixels
Size = tuple[int, int]  # width and height of the photo, pixels

SAME, NEAR = 0.9999, 0.7  # IoU of a duplicate, and of a near-duplicate
SLIVER_PX = 6.0  # shortest side of a box
GIANT_SIDE, GIANT_AREA = 0.6, 0.2  # shares of the photo
OUTSIDE_PX = 0.02  # what the rounding of six decimals explains
FEW, MANY = 4, 3  # shadows fewer or more than rocks

ROCK_CLASS, SHADOW_CLASS = (BOX_CLASSES.index(name) for name in (ROCK, SHADOW))
Polygons = list[tuple[int, np.ndarray]]  # class number, vertices (n, 2) in pixels
TINY_PX2, THIN_PX = 9.0, 2.0  # area and extent of a polygon
HUGE_PX2 = 300_000.0  # no rock and no shadow is so large
COVERED = 0.98  # of the photo that polygons must cover
COVER_STEP = 4  # pixels between the points at which the cover is looked at
LEAST_ROCKS = 3  # fewer tell no camera
BETTER_F1 = 0.1  # by which another camera's boxes must fit better
ALONE, ON_IT = 0.1, 0.5  # IoU of a box and a polygon that have nothing and that are one
BACKGROUND, GROUND, ROCK_POLYGON, SHADOW_POLYGON = (
    POLYGON_CLASSES.index(name) for name in ("background", "ground", ROCK, SHADOW)
)


def box_defects(classes: np.ndarray, boxes: np.ndarray, size: Size = (WIDTH, HEIGHT)) -> Iterator[Defect]:
    """Each defect at most once, with all boxes that have it."""
    overlap = np.triu(iou(boxes, boxes), 1)
    alike = classes[:, None] == classes[None]
    extent, photo = boxes[:, 2:] - boxes[:, :2], np.array(size, float)
    pairs = {
        "duplicate": alike & (overlap > SAME),
        "near_duplicate": alike & (overlap > NEAR) & (overlap <= SAME),
        "rock_on_shadow": ~alike & (overlap > NEAR),
    }
    singles = {
        "sliver": (extent < SLIVER_PX).any(axis=1),
        "giant": (extent > GIANT_SIDE * photo).any(axis=1) | (area(boxes) > GIANT_AREA * photo.prod()),
        "out_of_photo": ((boxes[:, :2] < -OUTSIDE_PX) | (boxes[:, 2:] > photo + OUTSIDE_PX)).any(axis=1),
    }
    for name, found in pairs.items():
        if found.any():
            first, second = np.argwhere(found)[0]
            later = tuple(np.flatnonzero(found.any(axis=0)).tolist())
            yield Defect(name, f"{found.sum()} pairs, first boxes {first + 1} and {second + 1}", later)
    for name, found in singles.items():
        if found.any():
            rows = np.flatnonzero(found)
            width, height = extent[rows[0]]
            detail = (
                f"{len(rows)} boxes, first box {rows[0] + 1}: class {classes[rows[0]]}, {width:.0f} x {height:.0f} px"
            )
            yield Defect(name, detail, tuple(rows.tolist()))


def count_defects(classes: np.ndarray) -> Iterator[Defect]:
    """Shadows that are far fewer or more than rocks."""
    rocks, shadows = int((classes == ROCK_CLASS).sum()), int((classes == SHADOW_CLASS).sum())
    if shadows and rocks - shadows >= FEW:
        yield Defect("few_shadows", f"{shadows} shadows of {rocks} rocks")
    if shadows - rocks >= MANY:
        yield Defect("many_shadows", f"{shadows} shadows of {rocks} rocks")


def ring_defects(polygons: Polygons) -> Iterator[Defect]:
    """Defects of single polygons, each at most once, with all that have it."""
    import shapely

    found: dict[str, list[int]] = {}
    for number, (kind, vertices) in enumerate(polygons):
        ring = shapely.Polygon(vertices)
        extent = np.ptp(vertices, axis=0)
        outside = (vertices < -OUTSIDE_PX).any() or (vertices > np.array([WIDTH, HEIGHT]) + OUTSIDE_PX).any()
        for name, holds in (
            ("invalid_ring", not ring.is_valid),
            ("tiny_polygon", ring.area < TINY_PX2),
            ("thin_polygon", extent.min() < THIN_PX),
            ("triangle", len(vertices) == 3),
            ("out_of_photo", outside),
            ("giant_shadow", kind == SHADOW_POLYGON and ring.area > HUGE_PX2),
        ):
            if holds:
                found.setdefault(name, []).append(number)
    for name, numbers in found.items():
        first = POLYGON_CLASSES[polygons[numbers[0]][0]]
        yield Defect(name, f"{len(numbers)} polygons, first polygon {numbers[0] + 1}: {first}", tuple(numbers))


def file_defects(polygons: Polygons) -> Iterator[Defect]:
    """Defects of a file as a whole; none of an empty one."""
    if not polygons:
        return
    kinds = np.array([kind for kind, _ in polygons])
    if GROUND not in kinds:
        yield Defect("no_ground")
        huge = tuple(
            number
            for number, (kind, vertices) in enumerate(polygons)
            if kind == ROCK_POLYGON and abs(signed_area(vertices)) > HUGE_PX2
        )
        if huge:
            yield Defect("ground_as_rock", f"polygon {huge[0] + 1}", huge)
    if ROCK_POLYGON in kinds and SHADOW_POLYGON not in kinds:
        yield Defect("no_shadow_polygon")
    if not covers_photo(polygons):
        yield Defect("cover_holes")
    objects = np.flatnonzero(np.isin(kinds, (ROCK_POLYGON, SHADOW_POLYGON)))
    late = np.flatnonzero(np.isin(kinds, (BACKGROUND, GROUND)))
    late = late[late > objects[0]] if len(objects) else late[:0]
    if len(late):
        kind = POLYGON_CLASSES[kinds[late[0]]]
        yield Defect("paint_order", f"polygon {late[0] + 1}: {kind}", tuple(late.tolist()))
    overlap = iou(boxes_of(polygons, ROCK_POLYGON), boxes_of(polygons, SHADOW_POLYGON))
    if (overlap > NEAR).any():
        yield Defect("polygons_coincide", f"{(overlap > NEAR).sum()} pairs")


def against_boxes(polygons: Polygons, labels: Boxes) -> Iterator[Defect]:
    """Objects that only one of the two files of a photo has."""
    classes, boxes = labels
    rocks, shadows = boxes_of(polygons, ROCK_POLYGON), boxes_of(polygons, SHADOW_POLYGON)
    rock_boxes, shadow_boxes = boxes[classes == ROCK_CLASS], boxes[classes == SHADOW_CLASS]
    for name, one, other in (
        ("rock_box_alone", rock_boxes, rocks),
        ("shadow_box_alone", shadow_boxes, shadows),
        ("rock_polygon_alone", rocks, rock_boxes),
        ("shadow_polygon_alone", shadows if len(shadow_boxes) else shadows[:0], shadow_boxes),
    ):
        alone = int((largest_iou(one, other) < ALONE).sum())
        if alone:
            yield Defect(name, f"{alone} of {len(one)}")
    on_rock = largest_iou(shadow_boxes, rocks) >= ON_IT
    mixed = int((on_rock & (largest_iou(shadow_boxes, shadows) < ALONE)).sum())
    if mixed:
        yield Defect("class_mismatch", f"{mixed} boxes")


def other_camera(polygons: Polygons, key: PhotoKey, labels: Mapping[PhotoKey, Boxes]) -> Iterator[Defect]:
    """Rocks of a file that fit the boxes of the other camera's photo better than those of its own."""
    rocks = boxes_of(polygons, ROCK_POLYGON)
    own, twin = labels.get(key), labels.get(key.other_camera)
    if own is None or twin is None or len(rocks) < LEAST_ROCKS:
        return
    mine, other = (_f1(rocks, boxes[classes == ROCK_CLASS]) for classes, boxes in (own, twin))
    if other >= mine + BETTER_F1:
        yield Defect("other_camera_polygons", f"F1 {other:.2f} with the other camera's boxes, {mine:.2f} with its own")


def _f1(first: np.ndarray, second: np.ndarray) -> float:
    pairs = len(match(iou(first, second), ON_IT)[0])
    return 2 * pairs / max(1, len(first) + len(second))


def boxes_of(polygons: Polygons, kind: int) -> np.ndarray:
    """(n, 4) boxes around the polygons of a class."""
    return np.array([around(vertices) for number, vertices in polygons if number == kind]).reshape(-1, 4)


def covers_photo(polygons: Polygons) -> bool:
    """Whether nearly every point of the photo lies in some polygon."""
    import cv2

    painted = np.zeros((HEIGHT // COVER_STEP, WIDTH // COVER_STEP), np.uint8)
    for _, vertices in polygons:  # one by one: together, overlaps would count as holes
        cv2.fillPoly(painted, [np.round(vertices / COVER_STEP).astype(np.int32)], (1,))
    return bool(painted.mean() >= COVERED)
