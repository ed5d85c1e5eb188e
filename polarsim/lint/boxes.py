"""What one file of boxes shows by itself."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from polarsim.geometry.boxes import area, iou
from polarsim.lint.rules import Defect
from polarsim.photo import BOX_CLASSES, HEIGHT, ROCK, SHADOW, WIDTH

Boxes = tuple[np.ndarray, np.ndarray]  # class numbers (n,), boxes (n, 4) in pixels
Size = tuple[int, int]  # width and height of the photo, pixels

SAME, NEAR = 0.9999, 0.7  # IoU of a duplicate, and of a near-duplicate
SLIVER_PX = 6.0  # shortest side of a box
GIANT_SIDE, GIANT_AREA = 0.6, 0.2  # shares of the photo
OUTSIDE_PX = 0.02  # what the rounding of six decimals explains
FEW, MANY = 4, 3  # shadows fewer or more than rocks

ROCK_CLASS, SHADOW_CLASS = (BOX_CLASSES.index(name) for name in (ROCK, SHADOW))


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
