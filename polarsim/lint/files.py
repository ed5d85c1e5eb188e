"""Defects of single label files, boxes or polygons, and of polygons compared with the boxes of the same photo."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from polarsim.geometry.boxes import area, box_around_points, iou, largest_iou, match_by_iou
from polarsim.geometry.polygons import signed_area
from polarsim.lint.rules import Defect
from polarsim.photo import BOX_CLASSES, POLYGON_CLASSES, REFERENCE_SIZE_PX, ROCK, SHADOW, PhotoKey, photo_scale

Boxes = tuple[np.ndarray, np.ndarray]  # class numbers (n,), boxes (n, 4) in pixels
Size = tuple[int, int]  # width and height of the photo, pixels

DUPLICATE_IOU, NEAR_DUPLICATE_IOU = 0.9999, 0.7  # minimum IoU of duplicates, and of near-duplicates
SLIVER_PX = 6.0  # minimum side of a box, px of a photo of the reference width
GIANT_SIDE, GIANT_AREA = 0.6, 0.2  # maximum shares of the photo
OUTSIDE_PX = 0.02  # rounding error of six decimals
MISSING_SHADOWS, EXTRA_SHADOWS = 4, 3  # minimum number of shadows fewer, or more, than rocks

ROCK_CLASS, SHADOW_CLASS = (BOX_CLASSES.index(name) for name in (ROCK, SHADOW))
Polygons = list[tuple[int, np.ndarray]]  # class number, vertices (n, 2) in pixels
TINY_PX2, MIN_EXTENT_PX = 9.0, 2.0  # minimum area and extent of a polygon
HUGE_SHARE = 300_000 / np.prod(REFERENCE_SIZE_PX)  # maximum area of a rock or shadow over that of the photo: 13 %
COVERED = 0.98  # minimum share of the photo that polygons cover
COVER_STEP = 4  # pixels between the samples of the coverage
MIN_ROCKS = 3  # minimum number of rocks that identify a camera
BETTER_F1 = 0.1  # minimum lead of the boxes of the other camera
MAX_UNMATCHED_IOU, MIN_MATCHED_IOU = 0.1, 0.5  # of a box without polygon, and of a box and its polygon
BACKGROUND, GROUND, ROCK_POLYGON, SHADOW_POLYGON = (
    POLYGON_CLASSES.index(name) for name in ("background", "ground", ROCK, SHADOW)
)


def box_defects(classes: np.ndarray, boxes: np.ndarray, size: Size) -> Iterator[Defect]:
    """Yield each defect at most once, with all boxes that have it."""
    overlap = np.triu(iou(boxes, boxes), 1)
    alike = classes[:, None] == classes[None]
    extent, photo = boxes[:, 2:] - boxes[:, :2], np.array(size, float)
    pairs = {
        "duplicate": alike & (overlap > DUPLICATE_IOU),
        "near_duplicate": alike & (overlap > NEAR_DUPLICATE_IOU) & (overlap <= DUPLICATE_IOU),
        "rock_on_shadow": ~alike & (overlap > NEAR_DUPLICATE_IOU),
    }
    singles = {
        "sliver": (extent < SLIVER_PX * photo_scale(size[0])).any(axis=1),
        "giant": (extent > GIANT_SIDE * photo).any(axis=1) | (area(boxes) > GIANT_AREA * photo.prod()),
        "out_of_photo": ((boxes[:, :2] < -OUTSIDE_PX) | (boxes[:, 2:] > photo + OUTSIDE_PX)).any(axis=1),
    }
    for name, defective in pairs.items():
        if defective.any():
            first, second = np.argwhere(defective)[0]
            later = tuple(np.flatnonzero(defective.any(axis=0)).tolist())
            yield Defect(name, f"{defective.sum()} pairs, first boxes {first + 1} and {second + 1}", later)
    for name, defective in singles.items():
        if defective.any():
            rows = np.flatnonzero(defective)
            width, height = extent[rows[0]]
            detail = (
                f"{len(rows)} boxes, first box {rows[0] + 1}: class {classes[rows[0]]}, {width:.0f} x {height:.0f} px"
            )
            yield Defect(name, detail, tuple(rows.tolist()))


def count_defects(classes: np.ndarray) -> Iterator[Defect]:
    """Yield defects of files with far fewer or more shadows than rocks."""
    rocks, shadows = int((classes == ROCK_CLASS).sum()), int((classes == SHADOW_CLASS).sum())
    if shadows and rocks - shadows >= MISSING_SHADOWS:
        yield Defect("few_shadows", f"{shadows} shadows of {rocks} rocks")
    if shadows - rocks >= EXTRA_SHADOWS:
        yield Defect("many_shadows", f"{shadows} shadows of {rocks} rocks")


def ring_defects(polygons: Polygons, size: Size) -> Iterator[Defect]:
    """Yield defects of single polygons, each at most once, with all polygons that have it."""
    import shapely

    rows: dict[str, list[int]] = {}
    for number, (kind, vertices) in enumerate(polygons):
        ring = shapely.Polygon(vertices)
        extent = np.ptp(vertices, axis=0)
        outside = (vertices < -OUTSIDE_PX).any() or (vertices > np.array(size) + OUTSIDE_PX).any()
        for name, present in (
            ("invalid_ring", not ring.is_valid),
            ("tiny_polygon", ring.area < TINY_PX2),
            ("thin_polygon", extent.min() < MIN_EXTENT_PX),
            ("triangle", len(vertices) == 3),
            ("out_of_photo", outside),
            ("giant_shadow", kind == SHADOW_POLYGON and ring.area > HUGE_SHARE * np.prod(size)),
        ):
            if present:
                rows.setdefault(name, []).append(number)
    for name, numbers in rows.items():
        first = POLYGON_CLASSES[polygons[numbers[0]][0]]
        yield Defect(name, f"{len(numbers)} polygons, first polygon {numbers[0] + 1}: {first}", tuple(numbers))


def file_defects(polygons: Polygons, size: Size) -> Iterator[Defect]:
    """Yield defects of an entire file; none of an empty file."""
    if not polygons:
        return
    kinds = np.array([kind for kind, _ in polygons])
    if GROUND not in kinds:
        yield Defect("no_ground")
        huge = tuple(
            number
            for number, (kind, vertices) in enumerate(polygons)
            if kind == ROCK_POLYGON and abs(signed_area(vertices)) > HUGE_SHARE * np.prod(size)
        )
        if huge:
            yield Defect("ground_as_rock", f"polygon {huge[0] + 1}", huge)
    if ROCK_POLYGON in kinds and SHADOW_POLYGON not in kinds:
        yield Defect("no_shadow_polygon")
    if not covers_photo(polygons, size):
        yield Defect("cover_holes")
    objects = np.flatnonzero(np.isin(kinds, (ROCK_POLYGON, SHADOW_POLYGON)))
    late = np.flatnonzero(np.isin(kinds, (BACKGROUND, GROUND)))
    late = late[late > objects[0]] if len(objects) else late[:0]
    if len(late):
        kind = POLYGON_CLASSES[kinds[late[0]]]
        yield Defect("paint_order", f"polygon {late[0] + 1}: {kind}", tuple(late.tolist()))
    overlap = iou(polygon_boxes(polygons, ROCK_POLYGON), polygon_boxes(polygons, SHADOW_POLYGON))
    if (overlap > NEAR_DUPLICATE_IOU).any():
        yield Defect("polygons_coincide", f"{(overlap > NEAR_DUPLICATE_IOU).sum()} pairs")


def polygon_box_mismatches(polygons: Polygons, labels: Boxes) -> Iterator[Defect]:
    """Yield defects of objects that only one of the two files of a photo contains."""
    classes, boxes = labels
    rocks, shadows = polygon_boxes(polygons, ROCK_POLYGON), polygon_boxes(polygons, SHADOW_POLYGON)
    rock_boxes, shadow_boxes = boxes[classes == ROCK_CLASS], boxes[classes == SHADOW_CLASS]
    for name, one, other in (
        ("rock_box_alone", rock_boxes, rocks),
        ("shadow_box_alone", shadow_boxes, shadows),
        ("rock_polygon_alone", rocks, rock_boxes),
        ("shadow_polygon_alone", shadows if len(shadow_boxes) else shadows[:0], shadow_boxes),
    ):
        alone = int((largest_iou(one, other) < MAX_UNMATCHED_IOU).sum())
        if alone:
            yield Defect(name, f"{alone} of {len(one)}")
    on_rock = largest_iou(shadow_boxes, rocks) >= MIN_MATCHED_IOU
    mixed = int((on_rock & (largest_iou(shadow_boxes, shadows) < MAX_UNMATCHED_IOU)).sum())
    if mixed:
        yield Defect("class_mismatch", f"{mixed} boxes")


def other_camera(polygons: Polygons, key: PhotoKey, labels: Mapping[PhotoKey, Boxes]) -> Iterator[Defect]:
    """Yield a defect if the rocks of a file fit the boxes of the other camera better."""
    rocks = polygon_boxes(polygons, ROCK_POLYGON)
    own, twin = labels.get(key), labels.get(key.other_camera)
    if own is None or twin is None or len(rocks) < MIN_ROCKS:
        return
    mine, other = (_f1(rocks, boxes[classes == ROCK_CLASS]) for classes, boxes in (own, twin))
    if other >= mine + BETTER_F1:
        yield Defect("other_camera_polygons", f"F1 {other:.2f} with the other camera's boxes, {mine:.2f} with this one")


def _f1(first: np.ndarray, second: np.ndarray) -> float:
    pairs = len(match_by_iou(iou(first, second), MIN_MATCHED_IOU)[0])
    return 2 * pairs / max(1, len(first) + len(second))


def polygon_boxes(polygons: Polygons, kind: int) -> np.ndarray:
    """Return the boxes (n, 4) around the polygons of a class."""
    return np.array([box_around_points(vertices) for number, vertices in polygons if number == kind]).reshape(-1, 4)


def covers_photo(polygons: Polygons, size: Size) -> bool:
    """Return whether nearly every point of the photo is inside a polygon."""
    import cv2

    painted = np.zeros((size[1] // COVER_STEP, size[0] // COVER_STEP), np.uint8)
    for _, vertices in polygons:  # in separate calls, because a single call treats overlaps as holes
        cv2.fillPoly(painted, [np.round(vertices / COVER_STEP).astype(np.int32)], (1,))
    return bool(painted.mean() >= COVERED)
