"""Rocks too low and gentle to tell from sand by shape, found where boxes of two positions meet on the ground."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, product

import numpy as np
from scipy import ndimage

from polarsim.geometry.boxes import around, iou
from polarsim.rocks.evidence import Evidence
from polarsim.rocks.ground import Sand
from polarsim.rocks.heights import filled
from polarsim.rocks.regions import PEAK_SHARE, Limits, Region, in_order, marked_region, surface_points

FLANK = 3  # cells about a point that may be its flanks and do not tell the ground's height below
ABOUT = 0.15  # metres about a point within which ground tells the ground's height below
LOWEST = 0.005  # metres that such a rock must rise above the ground about it: ripples and scanner's noise do not
RAISED = 0.001  # metres above the ground from which a cell is the rock's


def with_annotated(sand: Sand, regions: list[Region], limits: Limits, evidence: Evidence) -> tuple[Sand, list[Region]]:
    """Sand and regions after boxes that no region explains were looked into, where two positions have such boxes.

    Two boxes of different rocks meet somewhere too. A point counts as a rock where it fills both boxes and is higher
    than the ground about it.
    """
    left = evidence.unexplained([surface_points(sand, region.seen) for region in regions])
    left = {position: boxes for position, boxes in left.items() if len(boxes)}
    if len(left) < 2:
        return sand, regions
    cells = np.flatnonzero(np.isfinite(sand.surface) & sand.is_ground)
    points = surface_points(sand, cells)
    pixels = {position: evidence.localised[position].project("L", points) for position in left}
    found: list[Region] = []
    for one, other in combinations(sorted(left), 2):
        for pair in product(left[one], left[other]):
            shared = _shared([pixels[one], pixels[other]], pair, evidence.min_iou)
            shared &= sand.is_ground.ravel()[cells]  # two boxes of one rock find it once
            standing = raised(sand, cells[shared], RAISED, LOWEST)
            if standing is not None and standing[1].size >= limits.size:
                sand = standing[0]
                found.append(replace(standing[1], confirmed=(one, other)))
    return sand, in_order([*regions, *found])


def _shared(pixels: Sequence[np.ndarray], boxes: Sequence[np.ndarray], min_iou: float) -> np.ndarray:
    """(n,) bool: points, by their pixels (n, 2) in each photo, inside all boxes (4,); none unless they fill these."""
    inside = np.logical_and.reduce(
        [((seen > box[:2]) & (seen < box[2:])).all(axis=1) for seen, box in zip(pixels, boxes, strict=True)]
    )
    fills = inside.any() and all(
        iou(around(seen[inside])[None], box[None]) >= min_iou for seen, box in zip(pixels, boxes, strict=True)
    )
    return inside if fills else np.zeros_like(inside)


def raised(sand: Sand, cells: np.ndarray, foot: float, lowest: float) -> tuple[Sand, Region] | None:
    """Sand with the ground under flat cells (n,) filled in from around them, and what stands out of it there.

    That is what lies higher than `foot` metres, if its highest part is `lowest` metres high; else None.
    """
    if not len(cells):
        return None
    around = np.zeros(sand.surface.shape, bool)
    around.ravel()[cells] = True
    redrawn = ndimage.binary_dilation(around, iterations=FLANK)
    is_ground = sand.is_ground & ~redrawn
    window = _grown(ndimage.find_objects(redrawn.astype(np.int8))[0], round(ABOUT / sand.grid.cell))
    if not is_ground[window].any():
        return None
    ground = sand.ground.copy()
    interpolated = filled(np.nan_to_num(sand.surface[window]), is_ground[window])
    ground[window] = np.where(redrawn[window], interpolated, ground[window])
    below = replace(sand, is_ground=is_ground, ground=ground)
    standing = around & (below.above > foot)
    if not standing.any() or np.quantile(below.above[standing], PEAK_SHARE) < lowest:
        return None
    return below, marked_region(below, standing)


def _grown(window: tuple[slice, ...], margin: int) -> tuple[slice, ...]:
    """A window of the grid with a margin; beyond the grid it ends at the border."""
    return tuple(slice(max(0, part.start - margin), part.stop + margin) for part in window)
