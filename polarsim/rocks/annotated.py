"""Detection of rocks at annotated boxes that no region explains.

`add_annotated_rocks` detects rocks that are too low and gentle for detection by shape, from boxes of two positions;
`add_carved_rocks` detects rocks at boxes of single positions, cut from a region or raised from the ground.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product

import numpy as np
from scipy import ndimage

from polarsim.geometry.boxes import box_around_points, iou
from polarsim.rocks.creases import neighbours
from polarsim.rocks.evidence import ANNOTATION_IOU, Evidence
from polarsim.rocks.ground import SandSurface
from polarsim.rocks.grouping import group_pieces
from polarsim.rocks.heights import filled
from polarsim.rocks.regions import (
    PEAK_SHARE,
    Limits,
    RockRegion,
    largest_piece,
    measure_mask,
    region_of,
    scanned_points,
    sort_regions,
)

FLANK_CELLS = 3  # cells around a point that may be its flanks and are excluded from the ground below
GROUND_RADIUS = 0.15  # metres around a point within which ground determines the height of the ground below
MIN_ANNOTATED_HEIGHT = 0.005  # minimum height above the surrounding ground, metres; excludes ripples and noise
ANNOTATED_FOOT = 0.001  # minimum height above the ground of a rock's cells, metres
MIN_CUT_IOU = 0.65  # minimum IoU of the cut rock with its box: there is no second position to confirm it
BIN_PX = 8  # side of the squares of the photo that keep only the nearest points
VISIBLE_DEPTH = 0.05  # maximum distance from the nearest point of such a square, metres


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


@dataclass(frozen=True)
class _Cut:
    """Sand and regions after adding a rock at a box."""

    fit: float  # IoU of the rock with the box
    sand: SandSurface
    regions: list[RockRegion]


@dataclass(frozen=True)
class _ProjectedCells:
    """All scanned cells, projected to the photo of a position."""

    cells: np.ndarray  # (n,) flat
    pixels: np.ndarray  # (n, 2)
    away: np.ndarray  # (n,) metres from the camera

    def shown(self, box: np.ndarray) -> np.ndarray:
        """Return the cells (m,) in a box (4,) that no nearer cell occludes."""
        inside = np.flatnonzero(((self.pixels > box[:2]) & (self.pixels < box[2:])).all(axis=1))
        if not len(inside):
            return self.cells[inside]
        bins = np.floor(self.pixels[inside] / BIN_PX).astype(np.int64)
        number = np.unique(bins, axis=0, return_inverse=True)[1].ravel()
        nearest = np.full(number.max() + 1, np.inf)
        np.minimum.at(nearest, number, self.away[inside])
        return self.cells[inside[self.away[inside] < nearest[number] + VISIBLE_DEPTH]]


def add_carved_rocks(
    sand: SandSurface, regions: Sequence[RockRegion], limits: Limits, evidence: Evidence
) -> tuple[SandSurface, list[RockRegion]]:
    """Return sand and regions after adding rocks at boxes that no region explains.

    The rock of a box may be connected to another rock, or have a side as gentle as sand. Cells of a box are a rock if
    they fill the box and are higher than the surrounding ground, and if the remainder of the other rock fits its boxes
    as well as before at all positions. Finally, touching regions are joined if the boxes fit better: a box of a single
    position may cut off a piece of a rock that other positions show completely.
    """
    regions = list(regions)
    for position, boxes in evidence.unexplained(_surfaces(sand, regions)).items():
        if not len(boxes):
            continue
        cells = _project_cells(sand, evidence, position)
        for box in boxes:
            if any(
                evidence.fit(position, surface, box[None]) >= evidence.min_iou for surface in _surfaces(sand, regions)
            ):
                continue  # a previous box added this rock
            shown = cells.shown(box)
            cuts = (
                _cut(sand, regions, number, position, box, shown, limits, evidence)
                for number in (None, *range(len(regions)))
            )
            best = max((cut for cut in cuts if cut is not None), key=lambda cut: cut.fit, default=None)
            if best is not None:
                sand, regions = best.sand, best.regions
    return sand, sort_regions(_join_touching(sand, regions, evidence))


def _join_touching(sand: SandSurface, regions: list[RockRegion], evidence: Evidence) -> list[RockRegion]:
    """Join touching regions if they fit the boxes better."""
    numbers = np.zeros(sand.surface.shape, np.int64)
    for number, region in enumerate(regions, 1):
        numbers.ravel()[region.seen] = number
    reached = ndimage.grey_dilation(numbers, size=(3, 3))
    touching = [(first - 1, second - 1) for first, second in neighbours(np.where(numbers > 0, numbers, reached))]
    boxes = evidence.boxes(_surfaces(sand, regions))
    rock = group_pieces(np.arange(len(regions)), touching, boxes, evidence.agreed, evidence.min_iou)
    groups = [[regions[number] for number in np.flatnonzero(rock == label)] for label in np.unique(rock)]
    return [
        group[0] if len(group) == 1 else region_of(sand, np.concatenate([region.seen for region in group]), evidence)
        for group in groups
    ]


def _project_cells(sand: SandSurface, evidence: Evidence, position: str) -> _ProjectedCells:
    cells = np.flatnonzero(np.isfinite(sand.surface))
    points, rig = scanned_points(sand, cells), evidence.localised[position]
    away = np.linalg.norm(points - rig.sandbox_from_left.translation, axis=1)
    return _ProjectedCells(cells, rig.project("L", points), away)


def _cut(
    sand: SandSurface,
    regions: Sequence[RockRegion],
    number: int | None,
    position: str,
    box: np.ndarray,
    shown: np.ndarray,
    limits: Limits,
    evidence: Evidence,
) -> _Cut | None:
    """Cut the rock of the flat cells (n,) of a box from a region or from the ground; None if there is no rock."""
    region_cells = np.zeros(0, np.int64) if number is None else regions[number].seen
    if number is not None and not np.isin(shown, region_cells).any():
        return None
    others = np.concatenate(
        [region_cells[:0], *(region.seen for other, region in enumerate(regions) if other != number)]
    )
    standing = raised(sand, np.setdiff1d(shown, others), limits.foot, limits.confirmed_height)
    if standing is None:
        return None
    below, region = standing
    part = region_of(below, largest_piece(below, region.seen), evidence)
    fit = evidence.fit(position, scanned_points(sand, part.seen), box[None])
    if fit < MIN_CUT_IOU or part.size < limits.size or part.height < limits.confirmed_height:
        return None
    if number is None:
        return _Cut(fit, below, [*regions, part])
    rest = np.setdiff1d(region_cells, part.seen)
    if not len(rest) or not _fits_as_before(evidence, scanned_points(sand, region_cells), scanned_points(sand, rest)):
        return None
    remaining = region_of(below, rest, evidence)
    if remaining.size < limits.size:
        return None
    return _Cut(fit, below, [*regions[:number], remaining, *regions[number + 1 :], part])


def _fits_as_before(evidence: Evidence, before: np.ndarray, after: np.ndarray) -> bool:
    """Return whether the remainder (m, 3) of a rock (n, 3) fits its boxes about as well; False without a box."""
    annotated_somewhere = False
    for position, annotated in evidence.agreed.items():
        fit = evidence.fit(position, before, annotated)
        if fit < evidence.min_iou:
            continue
        annotated_somewhere = True
        if evidence.fit(position, after, annotated) < fit - ANNOTATION_IOU:
            return False
    return annotated_somewhere


def _surfaces(sand: SandSurface, regions: Sequence[RockRegion]) -> list[np.ndarray]:
    """Return the scanned points (n, 3) of every region."""
    return [scanned_points(sand, region.seen) for region in regions]
