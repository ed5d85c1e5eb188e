"""Detection of rocks that are too low and gentle for detection by shape, from boxes of two positions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, product

import numpy as np
from scipy import ndimage

from polarsim.geometry.boxes import box_around_points, iou
from polarsim.rocks.evidence import Evidence
from polarsim.rocks.ground import SandSurface
from polarsim.rocks.heights import filled
from polarsim.rocks.regions import PEAK_SHARE, Limits, RockRegion, measure_mask, scanned_points, sort_regions

FLANK_CELLS = 3  # cells around a point that may be its flanks and are excluded from the ground below
GROUND_RADIUS = 0.15  # metres around a point within which ground determines the height of the ground below
MIN_ANNOTATED_HEIGHT = 0.005  # minimum height above the surrounding ground, metres; excludes ripples and noise
ANNOTATED_FOOT = 0.001  # minimum height above the ground of a rock's cells, metres


def add_annotated_rocks(
    sand: SandSurface, regions: list[RockRegion], limits: Limits, evidence: Evidence
) -> tuple[SandSurface, list[RockRegion]]:
    """Return sand and regions after adding rocks at boxes of two positions that no region explains.

    Boxes of different rocks also intersect somewhere. Points are a rock if they fill both boxes and are higher than
    the surrounding ground.
    """
    unexplained = evidence.unexplained([scanned_points(sand, region.seen) for region in regions])
    unexplained = {position: boxes for position, boxes in unexplained.items() if len(boxes)}
    if len(unexplained) < 2:
        return sand, regions
    cells = np.flatnonzero(np.isfinite(sand.surface) & sand.is_ground)
    points = scanned_points(sand, cells)
    pixels = {position: evidence.localised[position].project("L", points) for position in unexplained}
    detected: list[RockRegion] = []
    for first, second in combinations(sorted(unexplained), 2):
        for pair in product(unexplained[first], unexplained[second]):
            shared = _shared([pixels[first], pixels[second]], pair, evidence.min_iou)
            shared &= sand.is_ground.ravel()[cells]  # two boxes of the same rock add it once
            standing = raised(sand, cells[shared], ANNOTATED_FOOT, MIN_ANNOTATED_HEIGHT)
            if standing is not None and standing[1].size >= limits.size:
                sand = standing[0]
                detected.append(replace(standing[1], confirmed=(first, second)))
    return sand, sort_regions([*regions, *detected])


def _shared(pixels: Sequence[np.ndarray], boxes: Sequence[np.ndarray], min_iou: float) -> np.ndarray:
    """Return a mask (n,) of points with pixels (n, 2) in all boxes (4,); empty if they do not fill the boxes."""
    inside = np.logical_and.reduce(
        [
            ((projected > box[:2]) & (projected < box[2:])).all(axis=1)
            for projected, box in zip(pixels, boxes, strict=True)
        ]
    )
    fills = inside.any() and all(
        iou(box_around_points(projected[inside])[None], box[None]) >= min_iou
        for projected, box in zip(pixels, boxes, strict=True)
    )
    return inside if fills else np.zeros_like(inside)


def raised(sand: SandSurface, cells: np.ndarray, foot: float, lowest: float) -> tuple[SandSurface, RockRegion] | None:
    """Interpolate the ground under flat cells (n,) from its surroundings, and return the region above it.

    The region consists of cells higher than `foot` metres; None if its height is less than `lowest` metres.
    """
    if not len(cells):
        return None
    around = np.zeros(sand.surface.shape, bool)
    around.ravel()[cells] = True
    redrawn = ndimage.binary_dilation(around, iterations=FLANK_CELLS)
    is_ground = sand.is_ground & ~redrawn
    window = _enlarge(ndimage.find_objects(redrawn.astype(np.int8))[0], round(GROUND_RADIUS / sand.grid.cell))
    if not is_ground[window].any():
        return None
    ground = sand.ground.copy()
    interpolated = filled(np.nan_to_num(sand.surface[window]), is_ground[window])
    ground[window] = np.where(redrawn[window], interpolated, ground[window])
    below = replace(sand, is_ground=is_ground, ground=ground)
    standing = around & (below.above > foot)
    if not standing.any() or np.quantile(below.above[standing], PEAK_SHARE) < lowest:
        return None
    return below, measure_mask(below, standing)


def _enlarge(window: tuple[slice, ...], margin: int) -> tuple[slice, ...]:
    """Enlarge a window of the grid by a margin, clipped at the border."""
    return tuple(slice(max(0, part.start - margin), part.stop + margin) for part in window)
