"""What can be wrong with labels: in one file, and against the other exposures of its photo set."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Literal

import numpy as np

from polarsim.geometry.boxes import area, iou, match_sum
from polarsim.photo import BOX_CLASSES, HEIGHT, POLYGON_CLASSES, WIDTH, PhotoKey, exposures

Severity = Literal["error", "warning"]
Boxes = tuple[np.ndarray, np.ndarray]  # class numbers (n,), boxes (n, 4) in pixels
Polygons = list[tuple[int, np.ndarray]]  # class number, vertices (n, 2) in pixels

SEVERITY: dict[str, Severity] = {
    "malformed": "error",  # a line that is no box or polygon of a known class, in the photo, with area
    "unreadable_mesh": "error",
    "unreadable_picture": "error",
    "out_of_photo": "error",
    "stray_name": "warning",
    "system_file": "warning",
    "impossible_exposure": "warning",
    "wrong_folder": "warning",
    "missing_file": "warning",
    "empty_file": "warning",
    "duplicate": "warning",
    "near_duplicate": "warning",
    "rock_on_shadow": "warning",
    "sliver": "warning",
    "giant": "warning",
    "rock_missing": "warning",
    "rock_extra": "warning",
    "rock_moved": "warning",
    "shadow_missing": "warning",
    "shadow_extra": "warning",
    "shadow_moved": "warning",
    "shadows_off_late": "warning",
    "invalid_ring": "warning",
    "tiny_polygon": "warning",
    "thin_polygon": "warning",
}

SAME, NEAR = 0.9999, 0.7  # IoU of a duplicate, and of a near-duplicate
FOUND, UNMOVED = 0.1, 0.9  # IoU of a box with its like in another exposure, and of one that did not move
SLIVER_PX = 6.0  # shortest side of a box
GIANT_SIDE, GIANT_AREA = 0.6, 0.2  # shares of the photo
OUTSIDE_PX = 0.02  # what the rounding of six decimals explains
TINY_PX2, THIN_PX = 9.0, 2.0  # area and extent of a polygon

_SIZE = np.array([WIDTH, HEIGHT], float)
_ROCK, _SHADOW = (BOX_CLASSES.index(name) for name in ("rock", "shadow"))


def box_defects(classes: np.ndarray, boxes: np.ndarray) -> Iterator[tuple[str, str]]:
    """(defect, detail) of one file, each defect at most once."""
    overlap = np.triu(iou(boxes, boxes), 1)
    alike = classes[:, None] == classes[None]
    extent = boxes[:, 2:] - boxes[:, :2]
    pairs = {
        "duplicate": alike & (overlap > SAME),
        "near_duplicate": alike & (overlap > NEAR) & (overlap <= SAME),
        "rock_on_shadow": ~alike & (overlap > NEAR),
    }
    singles = {
        "sliver": (extent < SLIVER_PX).any(axis=1),
        "giant": (extent > GIANT_SIDE * _SIZE).any(axis=1) | (area(boxes) > GIANT_AREA * _SIZE.prod()),
        "out_of_photo": ((boxes[:, :2] < -OUTSIDE_PX) | (boxes[:, 2:] > _SIZE + OUTSIDE_PX)).any(axis=1),
    }
    for defect, found in pairs.items():
        if found.any():
            first, second = np.argwhere(found)[0]
            yield defect, f"{found.sum()} pairs, first boxes {first + 1} and {second + 1}"
    for defect, found in singles.items():
        if found.any():
            number = np.flatnonzero(found)[0]
            name, (width, height) = BOX_CLASSES[classes[number]], extent[number]
            yield defect, f"{found.sum()} boxes, first box {number + 1}: {name} of {width:.0f} x {height:.0f} px"


def set_defects(files: Mapping[PhotoKey, Boxes]) -> Iterator[tuple[PhotoKey, str, str]]:
    """(photo, defect, detail) of the files of one photo set, against what most of them hold."""
    filled = {key: boxes for key, boxes in files.items() if len(boxes[0])}
    if filled:
        for key in sorted(set(files) - set(filled)):
            yield key, "empty_file", f"{len(filled)} other exposures have boxes"
    for number in (_ROCK, _SHADOW):
        of_kind = {key: boxes[classes == number] for key, (classes, boxes) in filled.items()}
        if number == _SHADOW:  # at short exposures the dark hides all shadows, which is no defect
            of_kind = {key: boxes for key, boxes in of_kind.items() if len(boxes)}
        yield from _against_modal(of_kind, BOX_CLASSES[number])
    seen: PhotoKey | None = None
    for key in sorted(files, key=lambda key: key.exposure_ms):
        shadows = int((files[key][0] == _SHADOW).sum())
        if seen and not shadows:
            yield key, "shadows_off_late", f"no shadow, but some at {seen.exposure_ms} ms"
        elif shadows and not seen:
            seen = key


def missing_exposures(there: set[PhotoKey]) -> list[PhotoKey]:
    """Photos that one Sun's nearly complete photo set has no file of; a set of which most is missing is no defect."""
    key = next(iter(there))
    whole = {key.with_exposure(exposure) for exposure in exposures(key.terrain, key.azimuth)}
    missing = whole - there
    return sorted(missing) if key.azimuth != "no" and len(missing) < len(whole) / 2 else []


def polygon_defects(polygons: Polygons) -> Iterator[tuple[str, str]]:
    """(defect, detail) of one file, each defect at most once."""
    import shapely

    found: dict[str, list[int]] = {}
    for number, (_, vertices) in enumerate(polygons):
        ring = shapely.Polygon(vertices)
        extent = np.ptp(vertices, axis=0)
        outside = (vertices < -OUTSIDE_PX).any() or (vertices > _SIZE + OUTSIDE_PX).any()
        for defect, holds in (
            ("invalid_ring", not ring.is_valid),
            ("tiny_polygon", ring.area < TINY_PX2),
            ("thin_polygon", extent.min() < THIN_PX),
            ("out_of_photo", outside),
        ):
            if holds:
                found.setdefault(defect, []).append(number)
    for defect, numbers in found.items():
        name = POLYGON_CLASSES[polygons[numbers[0]][0]]
        yield defect, f"{len(numbers)} polygons, first polygon {numbers[0] + 1}: {name}"


def _against_modal(boxes: Mapping[PhotoKey, np.ndarray], kind: str) -> Iterator[tuple[PhotoKey, str, str]]:
    """Boxes of one class that are missing, additional or elsewhere than in most exposures."""
    if not boxes:
        return
    modal = _modal(boxes)
    for key, here in boxes.items():
        overlap = iou(modal, here)
        rows, columns = match_sum(overlap)
        found = overlap[rows, columns][overlap[rows, columns] > FOUND]
        for defect, count in (
            ("missing", len(modal) - len(found)),
            ("extra", len(here) - len(found)),
            ("moved", int((found < UNMOVED).sum())),
        ):
            if count:
                yield key, f"{kind}_{defect}", f"{count} of {len(modal)}"


def _modal(boxes: Mapping[PhotoKey, np.ndarray]) -> np.ndarray:
    """(n, 4) the content that most files share; of equally frequent ones that with fewest boxes, then the shortest."""
    contents = [tuple(sorted(map(tuple, np.round(boxes[key], 1).tolist()))) for key in sorted(boxes)]
    times = Counter(contents)
    return np.array(max(times, key=lambda content: (times[content], -len(content)))).reshape(-1, 4)
